"""The mission as the process that a run starts, over real managers and a faked functional layer."""

from __future__ import annotations

import json
import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Mapping
from typing import Any

import pytest

pytest.importorskip("rclpy")
pytest.importorskip("btview")

from std_msgs.msg import Header
from std_srvs.srv import SetBool
from uav_skills_rig import Rig

from alula.common import run_log
from alula.common.record import EVENTS, FILE, OPERATOR, TREE, RecordFollower, read_record
from alula.trees.groot.address import Address
from alula_testing.waits import until

CLOCKS_APART_S = 0.1
"""Managers under load stamp by a clock message that is some ticks old."""
LANDS_WITHIN_M = 4.0  # of way, one second at 4 m/s
SILENT_S = 5.0
"""A mission that has told of no tick for so long (wall clock) is not waited for: at its end it ticks no more."""
ROUTE = {"route": [[0.0, 0.0, 3.0], [8.0, 0.0, 3.0], [8.0, 6.0, 3.0]]}


class Mission:
    """The process, and what it left behind."""

    def __init__(self, rig: Rig, out) -> None:
        self.rig = rig
        self.out = out
        out.mkdir()
        (out / "wanted.json").write_text(json.dumps(ROUTE))
        command = [
            sys.executable,
            "-m",
            "skillset_ros2.mission",
            "--scenario",
            "mapping",
            "--out",
            str(out),
            "--world",
            str(out / "wanted.json"),
        ]
        self.shown_at = Address(port=0).looked_up()
        self._ticked_s, self._heard_at_s = math.inf, 0.0
        self._heartbeat = rig.caller.create_subscription(Header, "/mission/heartbeat", self._hear, 10)
        rig.followers.append(self._heard_s)
        self.process = subprocess.Popen(
            [*command, "--ros-args", "-p", "use_sim_time:=true", "-p", f"groot:={self.shown_at.port}"], env=dict(os.environ)
        )

    def _hear(self, heartbeat: Header) -> None:
        self._ticked_s, self._heard_at_s = heartbeat.stamp.sec + heartbeat.stamp.nanosec * 1e-9, time.monotonic()

    def has_told(self) -> bool:
        """Return whether a heartbeat has come."""
        return self._heard_at_s > 0.0

    def _heard_s(self) -> float:
        """Return the mission clock of the last tick, infinite where none is to be waited for."""
        return math.inf if time.monotonic() - self._heard_at_s > SILENT_S else self._ticked_s

    def close(self) -> None:
        """End the process where it has not ended."""
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait(timeout=10.0)
        self.rig.followers.remove(self._heard_s)
        self.rig.caller.destroy_subscription(self._heartbeat)

    def until(self, what) -> None:
        # The clock goes on while the process starts: on a busy machine that is a minute of mission clock.
        self.rig.wait(lambda: self.process.poll() is not None or what(), timeout_s=300.0)
        assert self.process.poll() is None, self.account()

    def exit_code(self) -> int:
        return self.process.wait(timeout=40.0)

    def account(self) -> Mapping[str, Any]:
        return run_log.account(self.out, RecordFollower(self.out / FILE).poll())

    def seen(self) -> dict[int, str]:
        """Return the status of each node by its uid, as btview sees it now; nothing where it gets no answer in its time.

        The mission clock stands still meanwhile: a viewer starts for seconds, in which the flight would be over.
        """
        words = ["snapshot", "--uid", "--no-color", "--ascii", "--timeout", "20", "--port", str(self.shown_at.port)]
        wide = {**os.environ, "COLUMNS": "200"}
        with self.rig.clock_held():
            snapshot = subprocess.run(
                [sys.executable, "-m", "btview", *words], env=wide, capture_output=True, text=True, check=False, timeout=300
            )
        rows = [line.split("#")[1].split() for line in snapshot.stdout.splitlines() if "#" in line]
        return {int(row[0]): row[-1] for row in rows}

    def last_tree(self) -> dict:
        return [dict(entry.value) for entry in read_record(self.out) if entry.topic == TREE][-1]

    def events(self) -> list[dict]:
        return [dict(entry.value) for entry in read_record(self.out) if entry.topic == EVENTS]

    def executions(self, since: int = 0) -> list[tuple[str, str]]:
        return [(event["skill"], event["result"] or event["state"]) for event in self.events()[since:] if event["kind"] == "EXECUTION"]


def walk(node: dict) -> list[dict]:
    """Return a tree's nodes, by their uids from 1."""
    return [node, *(below for child in node["children"] for below in walk(child))]


@pytest.fixture(scope="module")
def whole_rig(ros2_domain):
    rig = Rig()
    yield rig
    rig.close()


@pytest.fixture
def mission(whole_rig, tmp_path):
    whole_rig.prepare()
    whole_rig.functional.reports_flight = True
    # Earlier tests of this process have left events of their own: the topics are transient local.
    mission = Mission(whole_rig, tmp_path / "run")
    yield mission
    mission.close()
    for node in whole_rig.nodes[:-1]:
        for execution in node.engine.executions:
            node.engine.interrupt(execution.id)
        whole_rig.wait(lambda node=node: not node.engine.executions)


def starts_since(mission: Mission, start_s: float) -> list[str]:
    events = [event for event in mission.events() if event["kind"] == "EXECUTION" and event["stamp_s"] >= start_s]
    return [event["skill"] for event in sorted(events, key=lambda event: event["stamp_s"]) if event["state"] == "RUNNING"]


def test_a_nominal_mission_leaves_a_complete_record(mission):
    assert mission.exit_code() == 0
    record = mission.account()
    assert (record["outcome"], record["reason"]) == ("accomplished", "")
    assert record["start_s"] < record["lift_off_s"] < record["end_s"]
    assert record["waypoints_reached"] == record["waypoints"] == 3
    assert record["inputs"]["route"] == ROUTE["route"]
    skills = starts_since(mission, record["start_s"] - CLOCKS_APART_S)
    assert skills[0] == "takeoff"
    assert sorted(skills[1:3]) == ["lidar_mapping", "zed_depthmap"]
    assert skills[3:] == ["goto_straight"] * 3 + ["land"]
    assert mission.last_tree()["status"] == "SUCCESS"
    assert (mission.out / "tree.svg").read_text().startswith("<svg")
    assert not mission.rig.functional.vehicle.in_air
    for skillset in ("navigation", "perception", "mapping"):
        numbers = [event["sequence"] for event in mission.events() if event["skillset"] == skillset]
        assert numbers == list(range(numbers[0], numbers[0] + len(numbers)))


def test_losing_the_zed_is_survived_within_a_second(mission):
    functional = mission.rig.functional
    mission.until(lambda: functional.names().count("set_position") == 2 and functional.vehicle.place[0] > 2.0)
    failure_s = functional.now_s
    functional.report("perception", "zed_status", "BROKEN")
    assert mission.exit_code() == 0
    record = mission.account()
    assert record["outcome"] == "degraded"
    assert "zed_ok" in record["reason"]
    after = [event for event in mission.events() if event["kind"] == "EXECUTION" and event["stamp_s"] >= failure_s - CLOCKS_APART_S]
    ends = {(event["skill"], event["state"]) for event in after}
    assert ("zed_depthmap", "RESOURCE_INVARIANT_VIOLATED") in ends
    assert ("goto_straight", "INTERRUPTED") in ends
    (lidar,) = [event for event in after if (event["skill"], event["state"]) == ("lidar_depthmap", "RUNNING")]
    assert lidar["stamp_s"] - failure_s < 1.0
    skills = starts_since(mission, failure_s - CLOCKS_APART_S)
    assert skills == ["lidar_depthmap", "rotate_head", "lock_head", "goto", "rotate_head", "lock_head", "goto", "land"]


def set_paused(mission: Mission, *, paused: bool) -> SetBool.Response:
    caller = mission.rig.caller.create_client(SetBool, "/mission/pause")
    assert caller.wait_for_service(30.0)
    answer = caller.call(SetBool.Request(data=paused), timeout_sec=30.0)
    mission.rig.caller.destroy_client(caller)
    return answer


def test_a_pause_holds_the_vehicle_on_its_way_and_the_mission_goes_on(mission):
    functional = mission.rig.functional
    mission.until(lambda: functional.names().count("set_position") == 2 and functional.vehicle.place[0] > 2.0)
    answer = set_paused(mission, paused=True)
    assert (answer.success, answer.message.startswith("the mission is paused: ")) == (True, True)
    mission.until(lambda: functional.names()[-1] == "hover")
    seen: dict[int, str] = {}
    mission.until(lambda: seen.update(mission.seen()) or seen)
    place, paused_s = list(functional.vehicle.place), functional.now_s
    mission.until(lambda: functional.now_s > paused_s + 3.0)
    assert list(functional.vehicle.place) == pytest.approx(place, abs=0.3)
    assert functional.names()[-1] == "hover"
    assert functional.vehicle.in_air
    answer = set_paused(mission, paused=False)
    assert (answer.success, answer.message) == (True, "the mission goes on")
    assert mission.exit_code() == 0
    record = mission.account()
    assert (record["outcome"], record["waypoints_reached"]) == ("accomplished", 3)
    entries = list(read_record(mission.out))
    told = [entry.value for entry in entries if entry.topic == OPERATOR]
    resumed = next(place for place, entry in enumerate(entries) if entry.topic == OPERATOR and entry.value["command"] == "resume")
    nodes = walk([entry.value for entry in entries[:resumed] if entry.topic == TREE][-1])
    assert list(seen) == list(range(1, len(nodes) + 1))
    assert {uid for uid, status in seen.items() if status == "RUNNING"} == {
        uid for uid, node in enumerate(nodes, start=1) if node["status"] == "RUNNING"
    }
    assert [(one["by"], one["command"]) for one in told] == [("mission", "pause"), ("mission", "paused"), ("mission", "resume")]
    assert "navigation.goto_straight holds" in told[1]["reason"]
    assert "perception.zed_depthmap goes on (zed_depthmap can't be paused)" in told[1]["reason"]


def test_losing_both_sensors_lands_where_it_is(mission):
    functional = mission.rig.functional
    mission.until(lambda: functional.names().count("set_position") == 2 and functional.vehicle.place[0] > 2.0)
    there_m = functional.vehicle.place[0]
    functional.report("perception", "zed_status", "BROKEN")
    functional.report("perception", "lidar_status", "BROKEN")
    assert mission.exit_code() == 1
    record = mission.account()
    assert record["outcome"] == "given_up"
    assert "zed_ok" in record["reason"]
    assert not functional.vehicle.in_air
    assert functional.vehicle.place[0] - there_m < LANDS_WITHIN_M
    assert functional.names()[-1] == "land"


def test_a_signal_in_the_air_lands_the_vehicle_first(mission):
    functional = mission.rig.functional
    mission.until(lambda: functional.names().count("set_position") == 2 and functional.vehicle.place[0] > 2.0)
    main: dict[int, str] = {}
    mission.until(lambda: main.update(mission.seen()) or main)
    assert functional.vehicle.in_air
    mission.process.send_signal(signal.SIGINT)
    mission.until(lambda: (stop := mission.seen()) and not main.keys() & stop.keys())  # what stops it is another tree
    assert mission.exit_code() == 1
    record = mission.account()
    assert (record["outcome"], record["reason"]) == ("aborted", "told to end by SIGINT")
    assert not functional.vehicle.in_air
    assert mission.last_tree()["name"] == "aborted mission"


def test_a_mission_that_is_told_to_end_before_the_start_does_not_start(whole_rig, tmp_path):
    whole_rig.prepare()
    whole_rig.set("navigation", "homepoint_status", "INVALID")
    mission = Mission(whole_rig, tmp_path / "run")
    mission.until(mission.account)
    assert mission.account()["outcome"] == "running"
    mission.process.send_signal(signal.SIGTERM)
    assert mission.exit_code() == 1
    assert mission.account()["outcome"] == "aborted"
    assert whole_rig.functional.names() == []


def test_the_first_heartbeat_comes_while_the_clock_stands_still(whole_rig, tmp_path):
    whole_rig.prepare()
    whole_rig.set("navigation", "homepoint_status", "INVALID")
    with whole_rig.clock_held():
        mission = Mission(whole_rig, tmp_path / "run")
        try:
            until(mission.has_told, "a heartbeat", 120.0)
            # Told to end and not killed: what is dead leaves its port of shared memory, and this process would write to that for some time,
            # not to the next process that takes the port's number.
            mission.process.terminate()
            assert mission.exit_code() == 1
        finally:
            mission.close()


def test_an_unreadable_route_can_not_start(tmp_path):
    words = ["--scenario", "mapping", "--out", str(tmp_path / "run"), "--world", str(tmp_path / "nowhere.yaml")]
    command = [sys.executable, "-m", "skillset_ros2.mission", *words]
    done = subprocess.run(command, capture_output=True, text=True, timeout=30.0, check=False)
    assert done.returncode == 2
    assert "nowhere.yaml" in done.stderr
    assert "Traceback" not in done.stderr
