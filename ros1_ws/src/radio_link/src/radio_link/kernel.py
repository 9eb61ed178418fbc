"""The radio as the kernel emulates it: runs what ``netem`` plans, and sends datagrams through it. Needs root and Linux."""

from __future__ import annotations

import contextlib
import ctypes
import os
import shutil
import socket
import subprocess
import threading
from collections.abc import Iterator, Sequence
from pathlib import Path

from radio_link import netem
from radio_link.channel import Condition
from radio_link.netem import Direction

NS = 1_000_000_000
CLONE_NEWNET = 0x40000000  # setns(2)
NAMESPACES = Path("/var/run/netns")
PORT = 5000
COMMAND_S = 10.0
CHANGE_PERIOD_NS = NS // 2  # a law changes the radio with every step of the vehicle; tc is a process each time


class KernelError(RuntimeError):
    """The kernel can't be the radio; the message says why, and what to do."""


def check() -> None:
    """Raise KernelError where this machine can't shape; leaves nothing behind."""
    if os.geteuid() != 0:
        raise KernelError("network namespaces need root: run it as root, or leave out --netem")
    for tool in ("ip", "tc"):
        if shutil.which(tool) is None:
            raise KernelError(f"the program {tool} is missing: install iproute2 (apt-get install iproute2), or leave out --netem")
    probe = f"alula-probe-{os.getpid()}"
    run([("ip", "netns", "add", probe)])
    try:
        for module, arguments in (("sch_tbf", netem.token_bucket(Condition(rate_bps=1e6))), ("sch_netem", ("netem", "delay", "1ms"))):
            try:
                run([("tc", "-n", probe, "qdisc", "replace", "dev", "lo", "root", *arguments)])
            except KernelError as error:
                raise KernelError(f"this kernel lacks {module} ({error}): load it (modprobe {module}), or leave out --netem") from error
    finally:
        run([("ip", "netns", "delete", probe)])


def run(commands: Sequence[netem.Command]) -> None:
    """Run commands one after the other; raise KernelError with the words of the first that fails."""
    for command in commands:
        done = subprocess.run(command, capture_output=True, text=True, timeout=COMMAND_S, check=False)
        if done.returncode != 0:
            said = " ".join((done.stderr or done.stdout).split()) or f"exit code {done.returncode}"
            raise KernelError(f"{' '.join(command[:6])}: {said}")


@contextlib.contextmanager
def namespaces(radio: netem.Radio) -> Iterator[None]:
    """Have the namespaces while the context lasts; what a run that was killed has left behind is removed first."""
    remove(radio)
    try:
        run(netem.set_up(radio))
        yield
    finally:
        remove(radio)


@contextlib.contextmanager
def checked_namespaces(radio: netem.Radio) -> Iterator[None]:
    """Have the namespaces where the kernel has all that it needs; raises KernelError before anything is made."""
    check()
    with namespaces(radio):
        yield


def remove(radio: netem.Radio) -> None:
    """Remove the namespaces that are there."""
    for command in netem.take_down(radio):
        if (NAMESPACES / command[-1]).exists():
            run([command])


def socket_in(namespace: str) -> socket.socket:
    """Return a UDP socket that lives in a namespace, for whatever thread; raises KernelError."""
    made: list[socket.socket | OSError] = []

    def make() -> None:
        # setns(2) moves the calling thread alone, and this one ends here.
        try:
            with (NAMESPACES / namespace).open() as file:
                failed = ctypes.CDLL(None, use_errno=True).setns(file.fileno(), CLONE_NEWNET)
            number = ctypes.get_errno()
            made.append(OSError(number, os.strerror(number)) if failed else socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
        except OSError as error:
            made.append(error)

    thread = threading.Thread(target=make)
    thread.start()
    thread.join()
    if isinstance(made[0], OSError):
        raise KernelError(f"the namespace {namespace} can't be entered: {made[0].strerror}") from made[0]
    return made[0]


class KernelChannel:
    """One direction of the radio, with the interface of ``Channel``; time is the kernel's own, so the wall's.

    ``socket`` is where the datagrams arrive: the loop that waits on it reads it, and tells by ``arrived``.
    """

    def __init__(self, radio: netem.Radio, direction: Direction, condition: Condition) -> None:
        self._radio, self._direction = radio, direction
        self._applied: Condition | None = None
        self._change_due_ns = 0
        self.condition = condition
        self.sent = self.delivered = self.lost = self.dropped = 0
        self.socket = socket_in(radio.namespace(direction.receiver))
        self.socket.bind((radio.address(direction.receiver), PORT))
        self.socket.setblocking(False)
        self._out = socket_in(radio.namespace(direction.sender))
        self._out.setblocking(False)
        self._apply()

    def send(self, data: bytes, now_ns: int) -> None:
        """Let the kernel take a datagram; one that its queue has no room for is dropped there."""
        del now_ns
        self.sent += 1
        try:
            self._out.sendto(data, (self._radio.address(self._direction.receiver), PORT))
        except OSError:  # ENOBUFS: the token bucket's queue is full
            self.dropped += 1

    def due(self, now_ns: int) -> list[bytes]:
        """Have the kernel follow the condition; what arrives comes by ``socket``."""
        if self.condition != self._applied and now_ns >= self._change_due_ns:
            self._change_due_ns = now_ns + CHANGE_PERIOD_NS
            self._apply()
        return []

    def arrived(self) -> None:
        """Count a datagram that was read; what was sent and neither dropped nor delivered was lost, or is on its way."""
        self.delivered += 1
        self.lost = self.sent - self.delivered - self.dropped

    def close(self) -> None:
        """Close both sockets."""
        self.socket.close()
        self._out.close()

    def _apply(self) -> None:
        run(netem.shape(self._radio, self._direction, self.condition))
        self._applied = self.condition
