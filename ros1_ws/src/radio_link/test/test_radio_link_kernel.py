"""The kernel as the radio: the commands as data, and, as root, real namespaces with real packets through the real token bucket.

netem itself is missing in many kernels: here a ``tc`` stands in front of the real one that notes what netem is told, or says what a
kernel without it says.
"""

from __future__ import annotations

import os
import select
import shutil
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest
from radio_link import kernel, netem
from radio_link.channel import OVERHEAD_BYTES, Condition
from radio_link.conditions import PRESETS, Quality
from radio_link.kernel import KernelChannel, KernelError
from radio_link.loop import udp_socket
from radio_link.netem import Direction, Radio

from alula.common.network import free_port
from alula_testing.ros1 import refusal_of_node
from alula_testing.waits import until

NODE = Path(__file__).parents[1] / "scripts/radio_link_node"
UNKNOWN = "Error: Specified qdisc kind is unknown."
DEGRADED = PRESETS[Quality.DEGRADED].down
root_only = pytest.mark.skipif(os.geteuid() != 0 or shutil.which("tc") is None, reason="needs root, ip and tc")


def test_a_condition_is_a_token_bucket_and_what_the_air_does():
    bucket, air = netem.shape(Radio(42000), Direction.DOWN, DEGRADED)
    assert " ".join(bucket) == ("tc -n alula-42000-drone qdisc replace dev radio root handle 1: tbf rate 600000bit burst 6000 limit 75000")
    assert " ".join(air) == (
        "tc -n alula-42000-air qdisc replace dev ground root handle 2: netem limit 10000 delay 50ms 10ms distribution normal "
        "loss gemodel 1% 25% 30% 0.5% rate 1gbit"
    )


def test_each_direction_has_queues_of_its_own():
    places = [(command[2], command[6]) for way in Direction for command in netem.shape(Radio(1), way, DEGRADED)]
    assert places == [("alula-1-drone", "radio"), ("alula-1-air", "ground"), ("alula-1-ground", "radio"), ("alula-1-air", "drone")]


def test_a_radio_that_is_out_loses_all_in_the_air_and_keeps_a_bucket_that_tc_takes():
    out = Condition(rate_bps=0.0)
    assert netem.air(out)[-4:] == ("loss", "100%", "rate", "1gbit")
    assert netem.token_bucket(out) == ("tbf", "rate", "1000bit", "burst", "6000", "limit", "12000")


def test_names_of_two_runs_do_not_meet():
    one, other = ({word for command in netem.set_up(Radio(n)) for word in command if word.startswith("alula-")} for n in (42000, 42010))
    assert len(one) == 3
    assert not one & other


def test_every_interface_name_fits_the_kernel():
    made = [command for command in netem.set_up(Radio(42000)) if command[1:3] == ("link", "add")]
    assert {name for command in made for name in (command[3], command[command.index("name") + 1])} == {"radio", "drone", "ground"}
    assert len(made) == 2


@pytest.fixture
def tc(tmp_path, monkeypatch):
    """Return what puts a ``tc`` in front of the real one: ``netem`` is its answer to netem's arguments, in shell."""

    def install(netem_answer: str) -> Path:
        told = tmp_path / "told"
        script = f'#!/bin/sh\ncase "$*" in *netem*) echo "$*" >> {told}; {netem_answer};; esac\nexec {shutil.which("tc")} "$@"\n'
        (tmp_path / "tc").write_text(script)
        (tmp_path / "tc").chmod(0o755)
        monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
        return told

    return install


@pytest.fixture
def radio(tc):
    made = Radio(90_000 + os.getpid() % 10_000)
    tc("exit 0")
    with kernel.namespaces(made):
        yield made
    assert not list(kernel.NAMESPACES.glob(f"alula-{made.number}-*"))


def through(way: KernelChannel, seconds: float) -> list[tuple[float, bytes]]:
    """Return what arrives, with the seconds after now."""
    begun, got = time.monotonic(), []
    while (left := begun + seconds - time.monotonic()) > 0.0:
        if select.select([way.socket], [], [], left)[0]:
            got.append((time.monotonic() - begun, way.socket.recv(3000)))
            way.arrived()
    return got


@root_only
@pytest.mark.parametrize("direction", Direction)
def test_packets_cross_at_the_rate_of_the_bucket(radio, direction):
    way = KernelChannel(radio, direction, Condition(rate_bps=800e3, queue_s=1.0))
    size = 1000
    for number in range(60):
        way.send(bytes([number]) + bytes(size - 1), 0)
    got = through(way, 1.0)
    assert [data[0] for _, data in got] == list(range(60)), "all of them, in order"
    took_s = got[-1][0] - got[0][0]
    expected_s = (60 * (size + OVERHEAD_BYTES + 14) - 6000) * 8 / 800e3
    assert took_s == pytest.approx(expected_s, rel=0.2)
    assert (way.sent, way.delivered, way.lost) == (60, 60, 0)
    way.close()


@root_only
def test_what_the_queue_has_no_room_for_is_dropped(radio):
    way = KernelChannel(radio, Direction.DOWN, Condition(rate_bps=200e3, queue_s=0.5))
    for _ in range(100):
        way.send(bytes(1000), 0)
    assert 10 < len(through(way, 1.5)) < 30
    way.close()


@root_only
def test_the_kernel_follows_a_change_but_not_more_than_twice_a_second(radio, tmp_path):
    told = tmp_path / "told"
    way = KernelChannel(radio, Direction.UP, PRESETS[Quality.GOOD].up)
    way.condition = DEGRADED
    for tick in range(10):
        assert way.due(tick * 100_000_000) == []
        way.condition = PRESETS[Quality.CRITICAL].up if tick > 2 else way.condition
    shown = subprocess.run(
        ["tc", "-n", radio.namespace(netem.GROUND), "qdisc", "show", "dev", "radio"], capture_output=True, text=True, check=True
    ).stdout
    assert "rate 32Kbit" in shown
    assert told.read_text().count("\n") == 3
    way.close()


@root_only
def test_what_a_killed_run_has_left_behind_hinders_no_later_run(tc):
    tc("exit 0")
    left = Radio(99_999)
    kernel.run(netem.set_up(left))
    with kernel.namespaces(left):
        KernelChannel(left, Direction.DOWN, DEGRADED).close()
    assert not (kernel.NAMESPACES / left.namespace(netem.AIR)).exists()


def probes() -> set[Path]:
    return set(kernel.NAMESPACES.glob("alula-probe-*"))


@root_only
def test_a_kernel_without_netem_is_told_in_one_line_and_nothing_is_left(tc):
    tc(f"echo '{UNKNOWN}' >&2; exit 2")
    before = probes()
    with pytest.raises(KernelError) as error:
        kernel.check()
    assert str(error.value).startswith("this kernel lacks sch_netem (")
    assert UNKNOWN in str(error.value)
    assert "leave out --netem" in str(error.value)
    assert "\n" not in str(error.value)
    assert probes() == before


def test_without_root_or_the_tools_it_says_so(monkeypatch):
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    with pytest.raises(KernelError, match="need root"):
        kernel.check()
    monkeypatch.setattr(os, "geteuid", lambda: 0)
    monkeypatch.setattr(shutil, "which", lambda _: None)
    with pytest.raises(KernelError, match="ip is missing: install iproute2"):
        kernel.check()


@root_only
def test_the_node_without_netem_ends_with_one_line(ros_master, tc):
    tc(f"echo '{UNKNOWN}' >&2; exit 2")
    assert "this kernel lacks sch_netem" in refusal_of_node([sys.executable, str(NODE), "_netem:=true"], ros_master)


@root_only
def test_every_flow_of_the_node_crosses_the_kernel(ros_master, start_node, tc):
    told = tc("exit 0")
    base = next(port for port in iter(free_port, None) if port < 60_000)
    listeners = {port: udp_socket(base + port) for port in (1, 3, 5, 8)}
    talker = udp_socket(0)
    start_node([str(NODE), "_netem:=true", f"_base_port:={base}"])
    until(lambda: told.exists() and told.read_text().count("\n") >= 2, "both ways are shaped", 30.0)

    def arrives(sender: socket.socket, to: int, at: int, data: bytes) -> tuple[str, int]:
        """Send until it arrives: the node's own ports open after the kernel's queues."""

        def comes() -> bool:
            sender.sendto(data, ("127.0.0.1", to))
            return bool(select.select([listeners[at]], [], [], 0.1)[0])

        until(comes, f"{data!r} at +{at}", 20.0)
        got, source = listeners[at].recvfrom(100)
        assert got == data
        return source

    arrives(talker, base, 1, b"video")
    arrives(talker, base + 2, 3, b"report")
    autopilots_peer = arrives(talker, base + 4, 5, b"control")
    arrives(listeners[5], autopilots_peer[1], 8, b"telemetry")
    assert (kernel.NAMESPACES / Radio(base).namespace(netem.AIR)).exists()
    for each in (talker, *listeners.values()):
        each.close()
