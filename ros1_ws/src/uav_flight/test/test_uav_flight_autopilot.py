"""How a real autopilot is reached, and which ports a run takes."""

from __future__ import annotations

import os
import socket
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest
from genpy import Time
from rosgraph_msgs.msg import Clock
from uav_flight_requests import flight_of, launch_arguments, parse, with_domain

from alula.common.network import NoFreePortError, free_port, udp_port_is_free, udp_ports_of
from alula.common.run_log import read_waits
from alula.report.live import LiveEvents
from alula.runtime.live.spec import RequestError, RunSpec
from alula_flight.mission_clock import MissionClock
from alula_flight.run import main
from alula_flight.waits import Beginning
from uav_flight.autopilot import body_port, check_connection, command_of_ardupilot, read_connection, read_sensors
from uav_flight.part import RADIO_PORTS, DronePart, Flight

EPHEMERAL = int(Path("/proc/sys/net/ipv4/ip_local_port_range").read_text(encoding="utf-8").split()[0])
DOMAIN = 77


@pytest.fixture
def holder() -> Iterator[socket.socket]:
    """Yield a UDP socket of another program, to be bound to loopback."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        yield other


@pytest.fixture
def instance() -> int:
    """Return an instance of ArduPilot's simulator that nobody on this machine has a body for."""
    return next(number for number in range(100, 250) if udp_port_is_free(9002 + 10 * number))


def spec_of(tmp_path: Path, autopilot: str, *more: str, sensors: str = "simulated") -> RunSpec:
    words = ["mapping", "--autopilot", autopilot, "--sensors", sensors, "--out", str(tmp_path / "run"), *more]
    return with_domain(parse(words), DOMAIN)


# --- ports -------------------------------------------------------------------------------------------------------------------


def test_the_radios_ports_are_a_runs_own_and_no_outgoing_connection_gets_them(tmp_path: Path) -> None:
    request = parse(["inspection", "--out", str(tmp_path / "run")])
    first = {domain: flight_of(request, domain).radio_port for domain in range(1, 102)}
    ports = {port + n for port in first.values() for n in range(RADIO_PORTS)}
    assert len(ports) == RADIO_PORTS * len(first), "no two runs meet"
    assert max(ports) < EPHEMERAL
    assert f"radio_port:={first[DOMAIN]}" in launch_arguments(with_domain(request, DOMAIN))


@pytest.mark.parametrize("nth", [0, 4, 9])
def test_ports_that_another_program_holds_are_left_to_it(nth: int, holder: socket.socket, tmp_path: Path) -> None:
    request = parse(["inspection", "--out", str(tmp_path / "run")])
    before = flight_of(request, DOMAIN).radio_port
    holder.bind(("127.0.0.1", before + nth))
    after = flight_of(request, DOMAIN).radio_port
    assert all(udp_port_is_free(after + n) for n in range(RADIO_PORTS))
    assert after not in {flight_of(request, other).radio_port for other in range(1, 102) if other != DOMAIN}


def test_ports_that_are_all_held_are_named(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    monkeypatch.setattr("alula.common.network.udp_port_is_free", lambda _: False)
    with pytest.raises(NoFreePortError, match=r"from each of 20760, 21770, .* on; end some first"):
        udp_ports_of(DOMAIN, first=20_000, step=10, count=10)
    assert main(["mapping", "--out", str(tmp_path / "run")]) == 2
    assert capsys.readouterr().err.count("\n") == 1


# --- the body's port ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("more", [0, 2, 9])
def test_the_body_is_where_the_instance_looks_for_it(more: int, instance: int, tmp_path: Path) -> None:
    """ArduPilot's instance N has MAVLink on TCP 5760 + 10 N and the next ports, and looks for the body on UDP 9002 + 10 N."""
    url = f"tcp:127.0.0.1:{5760 + 10 * instance + more}"
    spec = spec_of(tmp_path, url)
    assert f"ardupilot_port:={9002 + 10 * instance}" in launch_arguments(spec)
    said = command_of_ardupilot(read_connection(url), Flight.of(spec).body_port)
    assert said.startswith(f"arducopter -w --model JSON:127.0.0.1 -I{instance} --speedup 100 --defaults ")


def test_an_autopilot_behind_a_port_that_is_no_instances_is_told_which_it_is(tmp_path: Path) -> None:
    spec = spec_of(tmp_path, "tcp:127.0.0.1:15760")
    port = Flight.of(spec).body_port
    assert (port - 9002) % 10 == 0
    assert f" -I{(port - 9002) // 10} --speedup " in command_of_ardupilot(read_connection("tcp:127.0.0.1:15760"), port)


def test_two_flights_whose_autopilots_send_to_a_port_get_bodies_apart(tmp_path: Path) -> None:
    request = parse(["mapping", "--autopilot", f"udpin:127.0.0.1:{free_port()}", "--sensors", "simulated", "--out", str(tmp_path / "run")])
    ports = {flight_of(request, domain).body_port for domain in range(1, 102)}
    assert len(ports) == 101
    assert {port % 10 for port in ports} == {2}


def test_a_body_port_that_is_held_is_refused_with_what_to_do(holder: socket.socket, instance: int, tmp_path: Path) -> None:
    held, url = 9002 + 10 * instance, f"tcp:127.0.0.1:{5760 + 10 * instance}"
    holder.bind(("127.0.0.1", held))
    with pytest.raises(RequestError, match=f"--autopilot {url}: UDP port {held}, .* -I N"):
        spec_of(tmp_path, url)
    with pytest.raises(RequestError, match=f"--physics-port {held}: UDP port {held}"):
        spec_of(tmp_path, url, "--physics-port", f"{held}")
    port = free_port()
    assert Flight.of(spec_of(tmp_path, url, "--physics-port", str(port))).body_port == port
    assert f" -I{instance} --sim-port-out {port} " in command_of_ardupilot(read_connection(url), port)
    assert body_port(read_connection("udpin:127.0.0.1:14550"), DOMAIN) != held


# --- connections -------------------------------------------------------------------------------------------------------------


def test_a_character_device_is_a_serial_one() -> None:
    try:
        ours, theirs = os.openpty()
    except OSError as error:
        pytest.skip(f"no pseudo terminals here: {error}")
    device = os.ttyname(theirs)
    assert check_connection(device).kind == "serial"
    for handle in (ours, theirs):
        os.close(handle)


def test_a_file_is_no_serial_device(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(RequestError, match="is no serial device"):
        check_connection(str(tmp_path / "file"))


def test_a_port_to_listen_on_that_is_held_is_refused(holder: socket.socket) -> None:
    holder.bind(("127.0.0.1", 0))
    url = f"udpin:127.0.0.1:{holder.getsockname()[1]}"
    with pytest.raises(RequestError, match=f"--autopilot {url}: .* can't be listened on"):
        check_connection(url)
    with pytest.raises(RequestError, match=f"--sensors followed:{url}: .* can't be listened on"):
        read_sensors(f"followed:{url}")
    holder.close()
    assert check_connection(url).kind == "udpin"


# --- what a run waits for ----------------------------------------------------------------------------------------------------


def told(spec: RunSpec, **own: object) -> RunSpec:
    """Return a run of which something is otherwise."""
    return replace(spec, own={**spec.own, **own})


def test_it_is_said_for_what_a_run_waits(tmp_path: Path) -> None:
    part = DronePart()
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as server:
        server.bind(("127.0.0.1", 0))
        url = f"tcp:127.0.0.1:{server.getsockname()[1]}"
        spec = told(spec_of(tmp_path, url), body_port=9772)
        assert part.clock_source(spec) == "ArduPilot on UDP 9772"
        assert part.waits(spec, clock=False) == [f"the autopilot at {url}: connection refused, nothing listens there"]
        server.listen(1)
        assert part.waits(spec, clock=False) == []
        assert part.waits(spec, clock=True) == [f"the autopilot at {url}: no heartbeat has come"]
        part._hear_guidance(SimpleNamespace(link=True))
        assert part.waits(spec, clock=True) == []
    udp = f"udpin:127.0.0.1:{free_port()}"
    real = told(spec, autopilot=udp, sensors="")
    assert DronePart().waits(real, clock=True) == [f"the autopilot at {udp}: no heartbeat has come there"]
    followed = told(spec, autopilot=udp, sensors="followed:udpin:127.0.0.1:14551")
    assert part.clock_source(followed) == "the autopilot that is followed, at udpin:127.0.0.1:14551"
    simulated = told(spec, autopilot=None, sensors="")
    assert (part.clock_source(simulated), DronePart().waits(simulated, clock=True)) == ("the simulator", [])


def test_each_wait_is_shown_once_and_remembered_until_it_is_over(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("alula_flight.waits.LOOK_S", 0.0)
    monkeypatch.setattr("alula_flight.waits.TELL_CLOCK_S", 0.0)
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as server:
        server.bind(("127.0.0.1", 0))
        url = f"tcp:127.0.0.1:{server.getsockname()[1]}"
        spec = replace(told(spec_of(tmp_path, url), body_port=9772), out_dir=str(tmp_path))
        clock = MissionClock()
        clock.begin(simulated=True)
        beginning, said = Beginning(spec, DronePart(), clock), list[str]()
        live = LiveEvents(tmp_path, said.append)
        for tick in (False, False, True, True):
            if tick:
                clock._tick(Clock(clock=Time(1)))
            beginning.look()
            live.show_new()
        waited = ["ArduPilot on UDP 9772", f"the autopilot at {url}: connection refused"]
        assert [line.partition(",")[0] for line in said] == [f"waiting for {what}" for what in waited]
        assert list(read_waits(tmp_path).values()) == [True, False]
        server.listen(1)
        beginning.look()
        assert list(read_waits(tmp_path).values()) == [True, True, False], "it listens, but has said nothing yet"
