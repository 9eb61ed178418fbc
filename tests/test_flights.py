"""The mapping mission through the whole stack: nominal, and with sensors that fail. Two flights at a time share the machine.

The nominal flight goes around both kinds of corners of the yard, and those with a failure no further than the first: what follows
from it has happened.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import pytest
import ruamel.yaml
from rosbags.highlevel import AnyReader

from alula.common import run_log
from alula.common.record import read_record
from alula.model.execution_state import ExecutionState
from alula_testing.flights import ALULA_ROOT, Flight, in_order, start_flight, story

pytestmark = [pytest.mark.flight, pytest.mark.timeout(1200)]
Summary = dict[str, Any]
YARD = ALULA_ROOT / "ros1_ws/src/uav_simulator/worlds/yard.yaml"
FAILING_S = 12.0  # mission clock from lift-off; on the first leg
MIN_CLEARANCE_M = 0.8
MAX_RMSE_M = 0.15
MAX_RECOVERY_S = 1.0
MAX_RECORD_START_S = 0.02  # mission clock: the first tick
MAX_START_S = 2.0  # mission clock, until GUIDED; the start of the nodes takes ten times as long on the wall
MAX_CHECKS_S = 2.3  # from GUIDED until the mission begins: 1.5 s of the autopilot's checks in GUIDED, SYS_STATUS twice a second


def yard_of(legs: int, folder: Path) -> str:
    """Write the yard with the first of its four legs; return the file."""
    yaml = ruamel.yaml.YAML()
    world = yaml.load(YARD.read_text(encoding="utf-8"))
    del world["route"][legs + 1 :]
    path = folder / f"{legs}_legs.yaml"
    with path.open("w", encoding="utf-8") as file:
        yaml.dump(world, file)
    return str(path)


@pytest.fixture(scope="module")
def first_legs(tmp_path_factory: pytest.TempPathFactory) -> str:
    return yard_of(2, tmp_path_factory.mktemp("world"))


@pytest.fixture(scope="module")
def pair(tmp_path_factory: pytest.TempPathFactory, first_legs: str) -> Iterator[tuple[Flight, Flight]]:
    """Fly the nominal mission and the one that loses its ZED at the same time: parallel runs must not disturb each other."""
    base = tmp_path_factory.mktemp("flights")
    nominal = start_flight(base / "nominal", "--rate", "0", "--world", yard_of(3, base))
    failing = start_flight(base / "failing", "--rate", "0", "--fail", f"zed@{FAILING_S:g}", "--world", first_legs)
    yield nominal, failing
    nominal.give_up()
    failing.give_up()


@pytest.fixture(scope="module")
def nominal(pair: tuple[Flight, Flight]) -> Summary:
    pair[0].end(0)
    return pair[0].summary


@pytest.fixture(scope="module")
def failing(pair: tuple[Flight, Flight]) -> Summary:
    pair[1].end(0)
    return pair[1].summary


def executions(summary: Summary, skill: str) -> list[Summary]:
    return [e for e in summary["skills"] if e["skill"] == skill]


def assert_safe(summary: Summary) -> None:
    assert summary["landed"] is True
    assert summary["collisions"] == 0
    assert summary["min_clearance_m"] >= MIN_CLEARANCE_M


def test_nominal_mission_is_accomplished_and_safe(nominal: Summary) -> None:
    assert nominal["outcome"] == "accomplished"
    assert_safe(nominal)
    assert not executions(nominal, "lidar_depthmap")
    assert all(e["result"] == "ARRIVED" for e in executions(nominal, "goto_straight"))
    assert nominal["problems"] == []


@pytest.mark.usefixtures("nominal", "failing")
def test_the_recording_begins_when_simulated_time_does(pair: tuple[Flight, Flight]) -> None:
    for flight in pair:
        stamps_s = first_stamps_s(flight.out / "functional.bag", ("/imu/data", "/sim/true_pose"))
        assert max(stamps_s.values()) <= MAX_RECORD_START_S, stamps_s


def first_stamps_s(bag: Path, topics: Iterable[str]) -> dict[str, float]:
    """Return the stamp of the first message of each topic, seconds of mission clock."""
    found: dict[str, float] = {}
    with AnyReader([bag]) as reader:
        for topic in topics:
            connection, _, data = next(reader.messages([one for one in reader.connections if one.topic == topic]))
            stamp = reader.deserialize(data, connection.msgtype).header.stamp
            found[topic] = stamp.sec + stamp.nanosec / 1e9
    return found


@pytest.mark.usefixtures("nominal", "failing")
def test_how_long_nodes_take_to_start_changes_no_flight(pair: tuple[Flight, Flight]) -> None:
    for flight in pair:
        guided_s = guided_since_s(flight.out / "functional.bag")
        begun_s = run_log.account(flight.out, read_record(flight.out))["start_s"]
        assert guided_s < MAX_START_S
        assert begun_s - guided_s < MAX_CHECKS_S


def guided_since_s(bag: Path) -> float:
    """Return since when the guidance has the vehicle, seconds of mission clock."""
    with AnyReader([bag]) as reader:
        connections = [one for one in reader.connections if one.topic == "/uav_guidance/state"]
        states = (reader.deserialize(data, connection.msgtype) for connection, _, data in reader.messages(connections))
        stamp = next(state.header.stamp for state in states if state.authority)
    return float(stamp.sec + stamp.nanosec / 1e9)


def test_nominal_map_is_true_and_complete(nominal: Summary) -> None:
    assert nominal["map"]["rmse_m"] <= MAX_RMSE_M
    assert nominal["map"]["coverage"] >= 0.9


def test_every_execution_of_a_flight_ends_exactly_once(pair: tuple[Flight, Flight], nominal: Summary, failing: Summary) -> None:
    for flight, summary in zip(pair, (nominal, failing), strict=True):
        terminal = [e["id"] for e in flight.events() if e.get("skill") and ExecutionState(e["state"]).terminal]
        assert len(terminal) == len(set(terminal))
        assert set(terminal) == {e["id"] for e in summary["skills"]}


def test_losing_the_zed_reconfigures_the_mission(pair: tuple[Flight, Flight], failing: Summary) -> None:
    """The paper's Figure 12, as events in their order."""
    assert failing["outcome"] == "degraded"
    assert_safe(failing)
    (zed,) = executions(failing, "zed_depthmap")
    assert zed["outcome"] == "RESOURCE_INVARIANT_VIOLATED"
    assert "zed_ok" in (zed["result"] + zed["message"])
    interrupted = executions(failing, "goto_straight")[-1]
    assert interrupted["outcome"] == "INTERRUPTED"
    order = ["zed_depthmap", "lidar_depthmap", "rotate_head", "lock_head", "goto", "land"]
    asked = [e for e in in_order(pair[1]) if e["outcome"] != "NOT_READY"]
    first = {s: next(number for number, e in enumerate(asked) if e["skill"] == s) for s in order}
    assert sorted(order, key=lambda s: first[s]) == order
    assert zed["end_s"] <= asked[first["lidar_depthmap"]]["start_s"]


@pytest.mark.usefixtures("failing")
def test_mocks_fly_what_the_simulator_flew(pair: tuple[Flight, Flight], first_legs: str, tmp_path: Path) -> None:
    flight = start_flight(tmp_path / "mocked", "--mock", "--fail", f"zed@{FAILING_S:g}", "--world", first_legs)
    flight.end(0)
    assert story(flight) == story(pair[1])


def test_recovery_takes_less_than_a_second(failing: Summary) -> None:
    recovery = failing["recovery"]
    assert recovery["failure_s"] == pytest.approx(FAILING_S, abs=0.2)
    assert recovery["failure_s"] < recovery["detected_s"] <= recovery["fallback_running_s"] < recovery["moving_again_s"]
    assert recovery["fallback_running_s"] - recovery["failure_s"] <= MAX_RECOVERY_S


def test_degraded_map_is_true_and_covers_most(failing: Summary) -> None:
    assert failing["map"]["rmse_m"] <= MAX_RMSE_M
    assert failing["map"]["coverage"] >= 0.6


def test_the_folder_holds_what_it_should(pair: tuple[Flight, Flight], failing: Summary) -> None:
    assert failing["scenario"] == "mapping"
    out: Path = pair[1].out
    names = ("summary.json", "timeline.svg", "timeline.json", "tree.svg", "map.ply", "map.png", "world.ply", "functional.bag", "logs")
    for name in names:
        path = out / name
        assert path.exists(), name
        assert path.is_dir() or path.stat().st_size > 500, name
    assert json.loads((out / "timeline.json").read_text(encoding="utf-8"))


def test_both_sensors_failing_lands_where_it_is(tmp_path: Path) -> None:
    flight = start_flight(tmp_path / "blind", "--rate", "0", "--fail", "zed@5", "--fail", "lidar@5", "--seed", "3")
    try:
        flight.end(1)
    finally:
        flight.give_up()
    summary = flight.summary
    assert summary["outcome"] == "given_up"
    assert_safe(summary)
    assert executions(summary, "land")[-1]["result"] == "LANDED"
    assert summary["distance_m"] < 30.0
