"""The drone's options of a run: what is refused, and what reaches its launch files."""

from __future__ import annotations

import json
from types import SimpleNamespace

import pytest
from uav_flight_requests import launch_arguments, parse

from alula.common.network import free_port
from alula.runtime.live.spec import RunSpec
from alula_flight.outcome import CANNOT_START
from alula_flight.process_faults import process_faults_of
from alula_flight.run import main
from uav_flight.part import DronePart, Flight, sensors_words
from uav_simulator.world.config import find_world

ARDUPILOT = ["mapping", "--autopilot", "tcp:127.0.0.1:5760", "--sensors", "simulated"]


@pytest.mark.parametrize(
    ("arguments", "names"),
    [
        (["nosuch"], ["nosuch", "mapping"]),
        (["mapping", "--fail", "nosuch"], ["nosuch", "zed", "lidar"]),
        (["mapping", "--fail", "zed@x"], ["--fail", "zed@x", "camera:dark@30-40"]),
        (["mapping", "--fail", "zed:thinned"], ["zed can't be 'thinned'", "dark"]),
        (["mapping", "--world", "nowhere"], ["--world", "nowhere", "yard", "forest"]),
        (["mapping", "--fail", "zed@-1"], ["zed@-1"]),
        (["mapping", "--seed", "-3"], ["--seed -3"]),
        (["mapping", "--rate", "nan"], ["--rate nan"]),
        (["mapping", "--rate", "-1"], ["--rate -1"]),
        (["mapping", "--autopilot", "tcp:127.0.0.1:5760", "--fail", "zed@3"], ["--autopilot", "--sensors simulated"]),
        (["mapping", "--autopilot", "tcp:127.0.0.1:5760", "--imperfections", "realistic"], ["--imperfections"]),
        (["mapping", "--sensors", "simulated"], ["--sensors", "add --autopilot"]),
        (["mapping", "--autopilot", "tcp:127.0.0.1:5760", "--sensors", "real"], ["--sensors real", "simulated, or followed:URL"]),
        (["mapping", "--autopilot", "tcp:127.0.0.1:5760", "--sensors", "followed:"], ["--sensors followed:", "udpin:127.0.0.1:14551"]),
        (["mapping", "--imperfections", "some"], ["--imperfections", "'some'", "realistic"]),
        (["mapping", "--autopilot=/dev/../etc/passwd"], ["--autopilot /dev/../etc/passwd", "no serial device", "tcp:HOST:PORT"]),
        (["mapping", "--autopilot=/dev/nosuch"], ["/dev/nosuch", "no such device"]),
        (["mapping", "--autopilot=nonsense"], ["nonsense", "is no MAVLink connection"]),
        (["mapping", "--autopilot=file:///etc/passwd"], ["is no MAVLink connection"]),
        (["mapping", "--autopilot=tcp:127.0.0.1"], ["tcp:127.0.0.1", "needs a host and a port"]),
        (["mapping", "--autopilot=tcp::5760"], ["needs a host and a port"]),
        (["mapping", "--autopilot=udpin:127.0.0.1:70000"], ["port from 1 to 65535"]),
        (["mapping", "--autopilot=tcp:no such host:5760"], ["there is no host 'no such host'"]),
        ([*ARDUPILOT[:-1], "followed:/etc/passwd"], ["--sensors followed:/etc/passwd", "no serial device"]),
        ([*ARDUPILOT, "--physics-port", "0"], ["--physics-port 0"]),
        (["mapping", "--physics-port", "9012"], ["--physics-port", "--sensors simulated"]),
        (["inspection", *ARDUPILOT[1:], "--fail", "control@40"], ["--fail control", "only the simulated one"]),
        (["inspection", *ARDUPILOT[1:], "--fail", "ground_station:hung@40-60"], ["--fail ground_station", "only the simulated one"]),
    ],
)
def test_wrong_request_is_one_line_and_exit_code_2(arguments, names, capsys):
    assert main(arguments) == CANNOT_START
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    for name in names:
        assert name in said


def test_specification_survives_its_file(tmp_path):
    spec = parse(
        [
            "mapping",
            "--fail",
            "zed@30",
            "--fail",
            "lidar:sector@40-50",
            "--world",
            "forest",
            "--seed",
            "7",
            "--rate",
            "0",
            "--out",
            str(tmp_path / "run"),
        ]
    )
    spec.save(tmp_path / "run.json")
    assert RunSpec.load(tmp_path / "run.json") == spec
    assert {"faults:=zed@30,lidar:sector@40-50", f"world:={find_world('forest')}"} <= set(launch_arguments(spec))
    assert "simulate:=false" not in launch_arguments(spec)


def test_a_world_file_that_is_wrong_is_refused_with_its_line(tmp_path, capsys):
    world = tmp_path / "mine.yaml"
    world.write_text(find_world("yard").read_text().replace("keep_clear_m: 2.4", "keep_clear_m: far"))
    assert main(["mapping", "--world", str(world)]) == CANNOT_START
    line = 1 + find_world("yard").read_text().splitlines().index("keep_clear_m: 2.4")
    assert f"{world}:{line}: `keep_clear_m` should be a number" in capsys.readouterr().err


def test_real_autopilot_takes_the_place_of_the_simulator(tmp_path):
    url = f"udpin:127.0.0.1:{free_port()}"
    spec = parse(["mapping", "--autopilot", url, "--out", str(tmp_path / "run")])
    assert {"simulate:=false", f"autopilot:={url}"} <= set(launch_arguments(spec))


def test_ardupilot_flies_the_simulators_body(tmp_path):
    words = ["mapping", "--autopilot", "tcp:127.0.0.1:5760", "--sensors", "simulated", "--fail", "zed@30", "--out", str(tmp_path / "run")]
    spec = parse(words)
    assert {"vehicle:=ardupilot", "autopilot:=tcp:127.0.0.1:5760", "faults:=zed@30"} <= set(launch_arguments(spec))
    assert "simulate:=false" not in launch_arguments(spec)
    assert Flight.of(spec).simulated
    url = f"followed:udpin:127.0.0.1:{free_port()}"
    followed = parse([*words[:4], url, *words[5:]])
    assert {f"vehicle:={url}", "rate:=0", "faults:=zed@30"} <= set(launch_arguments(followed))
    assert Flight.of(followed).simulated
    assert not Flight.of(parse(["mapping", "--autopilot", "tcp:127.0.0.1:5760", "--out", str(tmp_path / "run")])).simulated
    imperfect = parse(["mapping", "--imperfections", "realistic,exposure=0", "--out", str(tmp_path / "run")])
    assert "imperfections:=realistic,exposure=0" in launch_arguments(imperfect)
    imperfect.save(tmp_path / "run.json")
    saved = json.loads((tmp_path / "run.json").read_text())
    assert (saved["imperfections"], "own" in saved) == ("realistic,exposure=0", False)
    assert RunSpec.load(tmp_path / "run.json") == imperfect


def test_sensors_are_recorded_where_that_is_asked_for_and_can_be():
    assert "record:=sensors" in launch_arguments(parse(["mapping", "--record", "sensors"]))
    assert "record:=functional" in launch_arguments(parse(["mapping"]))


def test_how_much_sensors_will_take_is_said(tmp_path):
    assert "about 4 MB a second of flight, 0.5 GB for two minutes" in sensors_words(tmp_path / "still/to/be/made")


def test_faults_go_to_the_program_that_applies_them(tmp_path):
    spec = RunSpec("inspection", str(tmp_path), "id", faults=("zed@3", "radio@4", "encoder@5", "ground_station:hung@6"))
    assert [(str(fault.request), fault.node, fault.mode) for fault in process_faults_of(spec)] == [
        ("encoder@5", "video_stream", "killed"),
        ("ground_station:hung@6", "ground_station", "hung"),
    ]
    assert {"faults:=zed@3", "radio_faults:=radio@4"} <= set(launch_arguments(spec))


def state(**changes):
    stamp = SimpleNamespace(to_sec=lambda: 1e9)  # of a computer with another clock
    told = {"link": True, "authority": False, "armed": True, "landed_state": 2, "mode": "BRAKE", **changes}
    return SimpleNamespace(header=SimpleNamespace(stamp=stamp), position_enu_m=SimpleNamespace(z=3.04), **told)


@pytest.mark.parametrize(
    ("last", "now_s", "held"),
    [
        (state(), 30.5, "the vehicle is to be landed, or given back by GUIDED: the pilot or a failsafe has it, in BRAKE, at 3.0 m"),
        (state(landed_state=4, mode="LAND"), 30.5, "in LAND, at 3.0 m"),
        (state(authority=True), 30.5, ""),
        (state(landed_state=1), 30.5, ""),
        (state(armed=False), 30.5, ""),  # it falls, or its autopilot has restarted: nobody flies it
        (state(link=False), 30.5, ""),  # nothing is known of it any more
        (state(), 36.0, ""),  # nor where the guidance has died or hangs
        (None, 36.0, ""),
    ],
)
def test_somebody_else_has_a_vehicle_that_flies_and_is_not_ours(last, now_s, held):
    part = DronePart()
    if last is not None:
        part._hear_guidance(last)
    part.held(SimpleNamespace(now_s=30.0))
    said = part.held(SimpleNamespace(now_s=now_s))
    assert held in said
    assert bool(held) == bool(said)
