"""Flights in the simulator, recorded by the project's own stack (``tests/recordings/make``), decided again at two depths."""

from __future__ import annotations

import importlib
import json
import os
import re
import shutil
from pathlib import Path

import pytest
from rosbags.highlevel import AnyReader
from rosbags.rosbag1 import Writer
from rosbags.typesys import get_types_from_msg

import alula.cli.replay
from alula.cli.replay import CANNOT_REPLAY, OTHERWISE, SAME
from alula.common.record import DECISIONS, FILE, MISSION, read_record
from alula_flight.replay import main

ALULA_ROOT = Path(os.environ["ALULA_ROOT"])
RECORDINGS = ALULA_ROOT / "tests" / "recordings"
FLIGHTS = sorted(path.parent.name for path in RECORDINGS.glob("*/skills.mcap"))
OTHERS = ALULA_ROOT.parent / "shared" / "data" / "bags"


@pytest.fixture(autouse=True)
def without_report(monkeypatch):
    """Make no report of a replay: seconds each; ``test_replay_outputs`` has those that are made."""
    monkeypatch.setattr(alula.cli.replay, "make_report", lambda *_: None)


def decided(run: Path) -> list[tuple]:
    """Return what was decided, without ids and times."""
    found = [entry.value for entry in read_record(run) if entry.topic == DECISIONS]
    return [(value["kind"], value["skill"], value["inputs"]) for value in found]


def mission(run: Path) -> dict:
    """Return how it ended."""
    return dict([entry.value for entry in read_record(run) if entry.topic == MISSION][-1])


@pytest.mark.parametrize("name", FLIGHTS)
def test_a_flight_is_decided_as_it_was_by_its_skills(name, tmp_path, capsys):
    words = ["--out", str(tmp_path / "again"), "--expect", str(RECORDINGS / name / "expect.yaml")]
    assert main([str(RECORDINGS / name), *words]) == SAME, capsys.readouterr().err
    assert decided(tmp_path / "again") == decided(RECORDINGS / name)
    assert mission(tmp_path / "again")["outcome"] == mission(RECORDINGS / name)["outcome"]


@pytest.mark.parametrize("name", ["mapping-zed", "inspection-radio"])
def test_the_real_hooks_decide_as_they_did(name, tmp_path, capsys):
    pytest.importorskip("uav_msgs")
    traces = set()
    for number in range(2 if name == "inspection-radio" else 1):
        out = tmp_path / f"again{number}"
        assert main([str(RECORDINGS / name), "--from", "functional", "--json", "--out", str(out)]) == SAME, capsys.readouterr().err
        traces.add(capsys.readouterr().out)
        assert decided(out) == decided(RECORDINGS / name)
        # The same ends by the same results: hooks saw the same reports of the functional layer.
        assert mission(out)["outcome"] == mission(RECORDINGS / name)["outcome"]
    assert len(traces) == 1


def test_replays_at_once_at_any_rate_and_under_load_are_the_same_bytes(monkeypatch, capsys):
    pytest.importorskip("uav_msgs")
    monkeypatch.syspath_prepend(str(RECORDINGS))
    repeat = importlib.import_module("repeat")
    words = [str(RECORDINGS / "mapping-zed"), "--rate", "20", "--rate", "35", "--rate", "50", "--from", "skills", "--from", "functional"]
    assert repeat.main(words) == SAME
    told = capsys.readouterr().out.splitlines()
    assert [line.partition(" (")[0] for line in told] == [
        f"mapping-zed from {depth}: 3 of 3 traces are equal" for depth in ("skills", "functional")
    ]
    assert all(line.endswith("3 decide as recorded") for line in told)


@pytest.mark.parametrize("depth", ["skills", "functional"])
def test_a_failure_that_was_not_flown_is_decided_as_the_one_that_was(depth, tmp_path, capsys):
    pytest.importorskip("uav_msgs")
    flown = RECORDINGS / "mapping-zed"
    assert main([str(RECORDINGS / "mapping"), "--from", depth, "--fail", "zed@6", "--on", "--out", str(tmp_path / "changed")]) == OTHERWISE
    assert decided(tmp_path / "changed") == decided(flown), capsys.readouterr().err
    changed, then = mission(tmp_path / "changed"), mission(flown)
    assert (changed["outcome"], changed["reason"].split(" (")[0]) == (then["outcome"], then["reason"].split(" (")[0])
    difference = json.loads((tmp_path / "changed/replay.json").read_text())["difference"]
    assert (difference["now"]["kind"], difference["now"]["skill"]) == ("interrupt", "goto_straight")


def with_heartbeats(source: Path, target: Path, *, until_s: float, again_s: float) -> None:
    """Copy a bag, with heartbeats of navigation's reporters, which are silent between two moments of mission clock."""
    gap_ns = range(round(until_s * 1e9), round(again_s * 1e9))
    with AnyReader([source]) as reader, Writer(target) as writer:
        types = reader.typestore
        kinds = {one.topic: one.msgtype for one in reader.connections}
        made = {topic: writer.add_connection(topic, kind, typestore=types) for topic, kind in kinds.items()}
        state, states = (f"skillset_interfaces/msg/{name}" for name in ("ResourceState", "ResourceStates"))
        for name in (state, states):
            text = (ALULA_ROOT / f"bridge/interfaces/{name}.msg").read_text(encoding="utf-8")
            types.register(get_types_from_msg(text, name))
        stamp = types.types["builtin_interfaces/msg/Time"](0, 0)
        header = types.types["std_msgs/msg/Header"](0, stamp, "")
        link = types.types[state]("link", "UP", "", 0, "")
        beat = types.serialize_ros1(types.types[states](header, "", 0, "navigation", [link]), states)
        beats, due_ns = writer.add_connection("/navigation/reported", states, typestore=types), 0
        for connection, stamp_ns, raw in reader.messages():
            if stamp_ns >= due_ns:
                due_ns = stamp_ns + 500_000_000
                if stamp_ns not in gap_ns:
                    writer.write(beats, stamp_ns, beat)
            writer.write(made[connection.topic], stamp_ns, raw)


def test_a_reporter_that_falls_silent_in_the_bag_makes_its_resource_unknown(tmp_path, capsys):
    pytest.importorskip("uav_msgs")
    for name, until_s in (("whole", 1e6), ("silent", 14.0)):
        run = Path(shutil.copytree(RECORDINGS / "mapping", tmp_path / name, ignore=shutil.ignore_patterns("functional.bag")))
        with_heartbeats(RECORDINGS / "mapping/functional.bag", run / "functional.bag", until_s=until_s, again_s=until_s + 3.0)
    assert main([str(tmp_path / "whole"), "--from", "functional"]) == SAME, capsys.readouterr().err
    assert main([str(tmp_path / "silent"), "--from", "functional", "--out", str(tmp_path / "again")]) == OTHERWISE
    assert "keep_link" in capsys.readouterr().err
    events = [one for one in read_record(tmp_path / "again") if one.value.get("resource") == "link"]
    assert [one.value["to_state"] for one in events] == ["UP", "UNKNOWN"]
    assert 15.5 < events[-1].stamp_s <= 16.1, "two seconds after the last heartbeat"
    assert events[-1].value["reason"] == "not heard of for 2 s"


BRANCHES = [f'<SubTree ID="{name.lower()}_navigation" name="{name} navigation" _autoremap="true"/>' for name in ("ZED", "LiDAR")]


def with_the_lidar_first(folder: Path) -> Path:
    """Write the mapping mission with its branches in the wrong order, and return the file."""
    missions = ALULA_ROOT / "missions"
    shutil.copy(missions / "flying.xml", folder)
    parts = re.split("({})".format("|".join(map(re.escape, BRANCHES))), (missions / "mapping.xml").read_text(encoding="utf-8"))
    before, first, between, second, after = parts
    (folder / "mapping.xml").write_text(before + second + between + first + after, encoding="utf-8")
    return folder / "mapping.xml"


@pytest.mark.parametrize(("depth", "name"), [("skills", "mapping"), ("functional", "mapping"), ("sensors", "mapping-sensors")])
def test_a_tree_with_its_branches_in_the_wrong_order_is_told(depth, name, tmp_path, capsys):
    pytest.importorskip("uav_msgs")
    assert main([str(RECORDINGS / name), "--from", depth, "--tree", str(with_the_lidar_first(tmp_path))]) == OTHERWISE
    said = capsys.readouterr().err
    assert "decisions differ at 2." in said
    assert "then: start perception.zed_depthmap at 2." in said
    assert "now:  start perception.lidar_depthmap at 2." in said


def weakened(folder: Path) -> Path:
    """Write a perception whose depth map goes on without its camera, and return the file."""
    text = (ALULA_ROOT / "skillsets/uav/perception.skill").read_text()
    weak = text.replace("zed_ok: resource = (zed_status == OK)", "zed_ok: resource = (zed_status != UNKNOWN)")
    assert weak != text
    (folder / "perception.skill").write_text(weak)
    return folder / "perception.skill"


@pytest.mark.parametrize("depth", ["skills", "functional"])
def test_a_weakened_invariant_is_told(depth, tmp_path, capsys):
    pytest.importorskip("uav_msgs")
    assert main([str(RECORDINGS / "mapping-zed"), "--from", depth, "--model", str(weakened(tmp_path))]) == OTHERWISE
    said = capsys.readouterr().err
    assert "then: interrupt navigation.goto_straight at 6." in said
    assert "now:  nothing" in said


@pytest.mark.parametrize("content", [b"", b"#ROSBAG V2.0\n", b"#ROSBAG V2.0\n" + b"\xff" * 4000, "cut", "definition", None])
def test_a_bag_that_can_not_be_read_is_refused_in_a_line(content, tmp_path, capsys):
    pytest.importorskip("uav_msgs")
    shutil.copy(RECORDINGS / "mapping" / FILE, tmp_path / FILE)
    bag = tmp_path / "functional.bag"
    if content == "cut":
        bag.write_bytes((RECORDINGS / "mapping/functional.bag").read_bytes()[:30000])
    elif content == "definition":
        bag.write_bytes((RECORDINGS / "mapping/functional.bag").read_bytes().replace(b"float64", b"fl{at\n4"))
    elif content is not None:
        bag.write_bytes(content)
    assert main([str(tmp_path), "--from", "functional"]) == CANNOT_REPLAY
    said = capsys.readouterr().err
    assert said.startswith("alula replay: ")
    assert "functional.bag" in said
    assert said.count("\n") == 1


def test_measurements_that_are_perceived_again_lead_to_the_decisions_of_the_flight(tmp_path, capsys):
    pytest.importorskip("uav_msgs")
    flown = RECORDINGS / "mapping-sensors"
    words = ["--from", "sensors", "--expect", str(flown / "expect.yaml"), "--out", str(tmp_path / "again")]
    assert main([str(flown), *words]) == SAME, capsys.readouterr().err
    assert decided(tmp_path / "again") == decided(flown)


def test_a_camera_that_is_made_to_die_in_the_measurements_is_decided_as_one_that_died_in_flight(tmp_path, capsys):
    """The recorded images are withheld, the real node notices, the real managers and the real tree answer."""
    pytest.importorskip("uav_msgs")
    words = ["--from", "sensors", "--fail", "zed@6", "--on", "--out", str(tmp_path / "changed")]
    assert main([str(RECORDINGS / "mapping-sensors"), *words]) == OTHERWISE, capsys.readouterr().err
    flown = RECORDINGS / "mapping-zed"
    assert decided(tmp_path / "changed") == decided(flown)
    changed, then = mission(tmp_path / "changed"), mission(flown)
    assert (changed["outcome"], changed["reason"].split(" (")[0]) == (then["outcome"], then["reason"].split(" (")[0])


def test_an_invariant_that_is_weakened_is_told_when_a_camera_dies_in_the_measurements(tmp_path, capsys):
    """The depth map ends as its hook finds it silent, two seconds after the invariant would have ended it."""
    pytest.importorskip("uav_msgs")
    words = ["--from", "sensors", "--fail", "zed@6", "--model", str(weakened(tmp_path))]
    expected = RECORDINGS / "mapping-zed" / "expect.yaml"
    assert main([str(RECORDINGS / "mapping-sensors"), *words, "--expect", str(expected)]) == OTHERWISE
    said = capsys.readouterr().err
    assert re.search(r"decisions differ at (7\.9|8\.0)", said), said
    assert "now:  interrupt navigation.goto_straight" in said
    line = next(number for number, text in enumerate(expected.read_text().splitlines(), 1) if "RESOURCE_INVARIANT_VIOLATED zed_ok" in text)
    broken = next(text for text in said.splitlines() if text.startswith(f"{expected}:{line}: perception.zed_depthmap"))
    assert broken.endswith("it never happens")
    assert "perception.zed_depthmap TERMINATED LOST besides" in said


def test_a_flight_whose_measurements_were_not_recorded_is_not_perceived_again(capsys):
    assert main([str(RECORDINGS / "mapping"), "--from", "sensors"]) == CANNOT_REPLAY
    said = capsys.readouterr().err
    assert "holds no measurements" in said
    assert said.count("\n") == 1


@pytest.mark.skipif(not OTHERS.is_dir(), reason=f"there are no bags of others in {OTHERS}")
def test_bags_of_others_are_refused_in_a_line(tmp_path, capsys):
    pytest.importorskip("uav_msgs")
    bags = sorted(OTHERS.glob("*.bag"))
    assert bags
    for bag in bags:
        assert main([str(bag), "--from", "functional"]) == CANNOT_REPLAY
        assert "does not tell which mission was run" in capsys.readouterr().err
        shutil.copy(RECORDINGS / "mapping" / FILE, tmp_path / FILE)
        shutil.copy(bag, tmp_path / bag.name)
        assert main([str(tmp_path / bag.name), "--from", "functional"]) == CANNOT_REPLAY
        assert "holds no calls of services" in capsys.readouterr().err


@pytest.mark.skipif(not OTHERS.is_dir(), reason=f"there are no bags of others in {OTHERS}")
def test_the_perception_judges_the_measurements_of_others(capsys):
    luminar = OTHERS / "embag_luminar_pointcloud2.bag"
    assert main([str(luminar), "--from", "sensors", "--map", "/luminar_pointcloud:=/lidar/points", "--json"]) == SAME
    told = [json.loads(line)["request"] for line in capsys.readouterr().out.splitlines()]
    # Less than one cloud a second: too few to fly by; and there is no camera.
    assert sorted((one["resource"], one["to"]) for one in told) == [("lidar_status", "BROKEN"), ("zed_status", "BROKEN")]
    for words in (["--map", "points"], []):
        assert main([str(luminar), "--from", "sensors", *words]) == CANNOT_REPLAY
        assert capsys.readouterr().err.count("\n") == 1
