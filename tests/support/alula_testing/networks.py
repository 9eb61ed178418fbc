"""Networks of a test's own: computers in network namespaces, joined by a switch, whose links can be cut and joined again.

A computer is a process that holds a network namespace and a mount namespace. It ends with the test process, whatever ends that, and with
it go its namespaces and its links: nothing has a name that could be left behind. A cut is silent, as on a radio link or behind a switch:
no carrier is lost, no program gets an error, what is sent goes nowhere. It is made by the sender's table of hardware addresses, so it
can be of one direction only.

    with Network() as network:
        base, here = network.computer("base"), network.here()
        subprocess.Popen(base.command("roscore"), env=base.ros1_environment(base))
        with network.cut(base, here):  # or one_way=True: nothing from base to here
            ...
"""

from __future__ import annotations

import itertools
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from shutil import which
from typing import Self

import pytest

from alula_testing.ros1 import END_WITH_PARENT
from alula_testing.waits import until

NOWHERE = "02:00:00:00:00:fe"
"""A hardware address that no computer has."""

PROGRAMS = ("ip", "mount", "nsenter", "unshare", "setpriv")
HOLD = "mount --bind $1 /etc/hosts && mount -t tmpfs shm /dev/shm && ip link set lo up && echo ready && exec sleep infinity"
"""A computer has shared memory of its own, too: DDS names what lies there by the domain, which others on this machine may have as well."""
BAD_CABLE = Path(__file__).with_name("bad_cable.py")
SEE_HOSTS = 'mount --bind $0 /etc/hosts && exec "$@"'
_numbers = itertools.count(1)


def why_impossible() -> str:
    """Return why this machine can't make namespaces, or an empty text."""
    missing = [program for program in PROGRAMS if which(program) is None]
    if missing:
        return f"no {', '.join(missing)} (util-linux, iproute2)"
    tried = subprocess.run(["unshare", "--net", "--mount", "ip", "link", "set", "lo", "up"], capture_output=True, text=True, check=False)
    return f"no namespaces: {tried.stderr.strip() or 'not root'}" if tried.returncode else ""


def _run(*words: str) -> None:
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"{' '.join(words)}: {done.stderr}"


@dataclass(eq=False)
class Computer:
    """A computer of a network. ``enter`` are the words that run a command there."""

    name: str
    address: str
    enter: tuple[str, ...]
    interface: str
    hardware: str
    port: str
    """Its end of the cable at the switch."""
    gone: set[str] = field(default_factory=set)

    def command(self, *words: str) -> list[str]:
        """Return a command that runs on this computer."""
        return [*self.enter, *words]

    def ros1_environment(self, master: Computer, *, port: int = 11311, by_name: bool = False) -> dict[str, str]:
        """Return an environment for ROS 1: the master on that computer, and this one known by its address or by its name."""
        environment = {**os.environ, "ROS_MASTER_URI": f"http://{master.name if by_name else master.address}:{port}"}
        for variable in ("ROS_IP", "ROS_HOSTNAME"):
            environment.pop(variable, None)
        environment |= {"ROS_HOSTNAME": self.name} if by_name else {"ROS_IP": self.address}
        return environment

    def ip(self, *words: str) -> None:
        """Run ``ip`` there; fails with what it says."""
        _run(*self.command("ip", *words))


class Network:
    """Computers on one switch. Addresses are the network's own: several networks may be there at a time. Skips the test without root."""

    def __init__(self) -> None:
        """Make a switch without computers."""
        if reason := why_impossible():
            pytest.skip(reason)
        self._number = (os.getpid() * 31 + next(_numbers)) % 0x3FFF
        self._ends = ExitStack()
        self._computers: list[Computer] = []
        self._folder = Path(self._ends.enter_context(tempfile.TemporaryDirectory(prefix="alula_network_")))
        self._hosts = self._folder / "hosts"
        self._hosts.write_text("127.0.0.1 localhost\n", encoding="utf-8")
        self._switch = self._hold()
        _run(*self._in(self._switch), "ip", "link", "add", "switch", "type", "bridge")
        _run(*self._in(self._switch), "ip", "link", "set", "switch", "up")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the computers; what runs on them has to be ended before."""
        self._ends.close()

    def _hold(self) -> int:
        """Start a process that holds namespaces; return its number."""
        words = [*END_WITH_PARENT, "unshare", "--net", "--mount", "sh", "-c", HOLD, "hold", str(self._hosts)]
        process = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
        self._ends.callback(process.wait)
        self._ends.callback(process.kill)
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        return process.pid

    @staticmethod
    def _in(pid: int) -> tuple[str, ...]:
        return ("nsenter", f"--target={pid}", "--net", "--mount")

    def computer(self, name: str) -> Computer:
        """Add a computer in namespaces of its own; the others know it by its name."""
        pid = self._hold()
        return self._connect(name, self._in(pid), str(pid))

    def here(self, name: str = "here") -> Computer:
        """Add this machine as it is, for what has to be in the test's own process."""
        computer = self._connect(name, ("unshare", "--mount", "sh", "-c", SEE_HOSTS, str(self._hosts)), str(os.getpid()))
        self._ends.callback(computer.ip, "link", "delete", computer.interface)  # it would go with the switch, a moment later
        return computer

    def _connect(self, name: str, enter: tuple[str, ...], pid: str) -> Computer:
        number = len(self._computers) + 1
        interface = f"al{self._number:x}n{number}"
        port = f"p{number}"
        computer = Computer(name, self._address(number), enter, interface, f"02:00:00:00:00:{number:02x}", port)
        _run(*self._in(self._switch), "ip", "link", "add", port, "type", "veth", "peer", "name", interface, "netns", pid)
        for words in (("master", "switch"), ("up",)):
            _run(*self._in(self._switch), "ip", "link", "set", port, *words)
        computer.ip("link", "set", interface, "address", computer.hardware)
        computer.ip("address", "add", f"{computer.address}/24", "dev", interface)
        computer.ip("link", "set", interface, "up")
        self._computers.append(computer)
        self._name_all()
        for other in self._computers[:-1]:
            self._lead(computer, other)
            self._lead(other, computer)
        return computer

    def _address(self, number: int) -> str:
        """Return an address of this network: one of 2^14 between 10.192.0.0 and 10.255.255.0."""
        return f"10.{192 + self._number // 256}.{self._number % 256}.{number}"

    def _name_all(self) -> None:
        lines = ["127.0.0.1 localhost", *(f"{one.address} {one.name}" for one in self._computers)]
        self._hosts.write_text("\n".join(lines) + "\n", encoding="utf-8")

    @staticmethod
    def _lead(sender: Computer, receiver: Computer) -> None:
        hardware = NOWHERE if receiver.name in sender.gone else receiver.hardware
        sender.ip("neighbour", "replace", receiver.address, "lladdr", hardware, "dev", sender.interface, "nud", "permanent")

    @contextmanager
    def cut(self, one: Computer, other: Computer, *, one_way: bool = False) -> Iterator[None]:
        """Let nothing pass between two computers; with ``one_way`` nothing from the first to the second."""
        ways = [(one, other)] if one_way else [(one, other), (other, one)]
        for sender, receiver in ways:
            sender.gone.add(receiver.name)
            self._lead(sender, receiver)
        try:
            yield
        finally:
            for sender, receiver in ways:
                sender.gone.discard(receiver.name)
                self._lead(sender, receiver)

    def move(self, computer: Computer) -> None:
        """Give a computer another address, as DHCP may; its name leads there, what is open to the old address leads nowhere."""
        old = computer.address
        computer.address = self._address((int(old.rpartition(".")[2]) + 50) % 250)
        computer.ip("address", "delete", f"{old}/24", "dev", computer.interface)
        computer.ip("address", "add", f"{computer.address}/24", "dev", computer.interface)
        self._name_all()
        for other in self._computers:
            if other is not computer:
                self._lead(computer, other)  # forgotten with the address
                self._lead(other, computer)
                other.ip("neighbour", "replace", old, "lladdr", NOWHERE, "dev", other.interface, "nud", "permanent")

    @contextmanager
    def without_address(self, computer: Computer) -> Iterator[None]:
        """Take a computer's address from it, as when its lease ends: it answers nothing, and what is open on it can send nothing.

        No end of a connection is told that the other one can't be reached.
        """
        computer.ip("address", "delete", f"{computer.address}/24", "dev", computer.interface)
        try:
            yield
        finally:
            computer.ip("address", "add", f"{computer.address}/24", "dev", computer.interface)
            for other in self._computers:
                if other is not computer:
                    self._lead(computer, other)  # forgotten with the address

    @contextmanager
    def bad_cable(self, computer: Computer, *, delay_s: float, loss: float, seed: int) -> Iterator[None]:
        """Have a computer's cable lose this part of the frames, and delay the others, each way (``alula_testing.bad_cable``)."""
        inside = self._in(self._switch)
        port, cable, ends = computer.port, f"cable{computer.port}", (f"near{computer.port}", f"far{computer.port}")
        words = [*END_WITH_PARENT, *inside, sys.executable, str(BAD_CABLE), *ends, str(delay_s), str(loss), str(seed)]
        process = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == "ready\n"
            _run(*inside, "ip", "link", "add", cable, "type", "bridge")
            for end, bridge in ((ends[0], cable), (ends[1], "switch"), (port, cable)):
                _run(*inside, "ip", "link", "set", end, "master", bridge, "up")
            _run(*inside, "ip", "link", "set", cable, "up")
            yield
        finally:
            _run(*inside, "ip", "link", "set", port, "master", "switch")
            subprocess.run([*inside, "ip", "link", "delete", cable], check=False)  # where it came so far
            process.kill()
            process.wait()

    def wait_reached(self, sender: Computer, receiver: Computer) -> None:
        """Return when packets from one come back from the other; needs ``ping`` no more than a closed port does."""
        probe = f"exec 3<>/dev/tcp/{receiver.address}/9"

        def answers() -> bool:
            tried = subprocess.run(sender.command("timeout", "1", "bash", "-c", probe), capture_output=True, text=True, check=False)
            return "refused" in tried.stderr or tried.returncode == 0

        until(answers, f"{receiver.name} answers {sender.name}")
