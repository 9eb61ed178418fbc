"""Whole reports: a flight that loses its depth camera, with every number known; and runs of which little is left."""

from __future__ import annotations

import json
import math
import shutil
import sys
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import matplotlib.image as mpl_image
import numpy as np
import pytest

from alula.common import run_log
from alula.common.record import FILE as RECORD
from alula.report import __main__ as report
from alula.report.facts import RunFacts
from alula.report.making import make_report
from alula.report.page.embedded import read_report
from alula.report.page.entries import CAUSES
from alula.report.verdict import verdict_lines

sys.path.insert(0, str(Path(__file__).parent))
from test_report_sample import write_bag, write_map, write_world

from alula_testing.run_log import LIFT_OFF_S, Log, failing_flight

OUTPUTS = {"report.html", "summary.json", "timeline.json", "timeline.svg", "map.png"}
ROUTE = [[0.0, 0.0, 3.0], [22.0, 0.0, 3.0], [22.0, 14.0, 3.0], [44.0, 14.0, 3.0], [44.0, -4.0, 3.0]]
# Seconds since lift-off and places of the flight that `failing_flight` tells of.
FLOWN = [
    (-8, 0, 0, 0.3),
    (0, 0, 0, 0.3),
    (4.6, 0, 0, 3),
    (5, 0, 0, 3),
    (27, 22, 0, 3),
    (27.5, 22, 0, 3),
    (30.3, 22, 2.8, 3),
    (30.6, 22, 2.9, 3),
]
FLOWN += [
    (33.4, 22, 2.9, 3),
    (45.4, 22, 14, 3),
    (48.5, 22, 14, 3),
    (70.5, 44, 14, 3),
    (73.6, 44, 14, 3),
    (91.6, 44, -4, 3),
    (91.8, 44, -4, 3),
]
FLOWN += [(98.8, 44, -4, 0.3), (101.0, 44, -4, 0.3)]
WALL = ((-8.0, 1.9, 0.0), (15.0, 2.2, 6.0))
LANDING_S, TOUCH_DOWN_S = 91.92, 98.8


def facts(folder: Path, **changes: Any) -> RunFacts:
    return RunFacts(**{"scenario": "mapping", "seed": 3, "out_dir": folder, "faults": ["zed@30"], "died": [], "mission_exit": 0, **changes})


def poses() -> tuple[np.ndarray, np.ndarray]:
    told = np.array(FLOWN)
    t_s = np.arange(-80, 1011) / 10
    return t_s + LIFT_OFF_S, np.stack([np.interp(t_s, told[:, 0], told[:, axis]) for axis in (1, 2, 3)], axis=1)


def guidance(t_s: np.ndarray) -> list[dict[str, Any]]:
    def reference(since_s: float) -> str:
        return "takeoff" if since_s < 4.6 else "position" if since_s < LANDING_S else "land" if since_s < TOUCH_DOWN_S else "idle"

    on_ground = [since_s < 0 or since_s >= TOUCH_DOWN_S for since_s in t_s - LIFT_OFF_S]
    return [
        {"t_s": t, "reference": reference(t - LIFT_OFF_S), "landed_state": 1 if down else 2} for t, down in zip(t_s, on_ground, strict=True)
    ]


def lay_out(folder: Path) -> None:
    """Write what a flight leaves behind."""
    folder.mkdir(exist_ok=True)
    failing_flight().write(folder / RECORD)
    write_world(folder / "world.ply", [WALL], ([-20, -25], [60, 35]))
    xs, ys = np.meshgrid(np.arange(-20, 60, 0.2), np.arange(-25, 35, 0.2))
    ground = np.stack([xs.ravel(), ys.ravel(), np.full(xs.size, 0.04)], axis=1)
    write_map(folder / "map.ply", ground)
    mission = {"outcome": "degraded", "reason": "zed_depthmap: zed_works was violated", "inputs": {"route": ROUTE}}
    run_log.note(folder, run_log.MISSION, mission)
    (folder / "logs").mkdir(exist_ok=True)
    (folder / "logs/bridge.json").write_text('{"topics": {"/clock": {"count": 5000, "p50_ms": 0.4, "p95_ms": 1.5, "dropped": 0}}}')
    t_s, position = poses()
    fault = {"sensor": "zed", "mode": "dead", "t_s": LIFT_OFF_S + 30.0}
    state = {"t_s": 113.0, "lift_off_s": LIFT_OFF_S, "collisions": 0, "min_clearance_m": 1.1, "distance_m": 83.0, "faults": [fault]}
    write_bag(folder / "functional.bag", poses=(t_s, position), states=[state], guidance=guidance(t_s), map_points=5)


@pytest.fixture(scope="module")
def left_behind(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder as a flight leaves it; to be copied, not changed."""
    folder = tmp_path_factory.mktemp("left") / "run"
    lay_out(folder)
    return folder


@pytest.fixture
def folder(left_behind: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(left_behind, tmp_path / "run"))


@pytest.fixture(scope="module")
def whole(left_behind: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    folder = Path(shutil.copytree(left_behind, tmp_path_factory.mktemp("runs") / "run"))
    died = [
        {"name": "zed_depth", "when_s": LIFT_OFF_S + 12.0, "how": "signal SIGKILL", "again_s": LIFT_OFF_S + 13.5},
        {"name": "record", "when_s": None, "how": "exit code 1", "again_s": None},
    ]
    return folder, dict(make_report(facts(folder, died=died)))


def test_the_flight_in_numbers(whole):
    _, summary = whole
    assert {key: summary[key] for key in ("scenario", "outcome", "landed", "seed", "collisions", "mission_exit", "problems")} == {
        "scenario": "mapping",
        "outcome": "degraded",
        "landed": True,
        "seed": 3,
        "collisions": 0,
        "mission_exit": 0,
        "problems": [],
    }
    assert summary["reason"] == "zed_depthmap: zed_works was violated"
    assert summary["duration_s"] == pytest.approx(98.8)
    assert summary["min_clearance_m"] == 1.1, "the simulator's, who sees more than 20 moments a second"
    assert summary["distance_m"] == 83.0
    assert summary["lift_off"] == {"stamp_s": LIFT_OFF_S, "source": "simulator"}
    assert summary["bridge"] == {"/clock": {"count": 5000, "p50_ms": 0.4, "p95_ms": 1.5, "dropped": 0}}
    assert summary["died"] == [
        {"name": "zed_depth", "when_s": 12.0, "how": "signal SIGKILL", "again_s": 13.5},
        {"name": "record", "when_s": None, "how": "exit code 1", "again_s": None},
    ]


def test_what_no_simulator_has_counted_is_computed_from_the_true_path(folder):
    t_s, position = poses()
    write_bag(folder / "functional.bag", poses=(t_s, position), guidance=guidance(t_s))
    summary = make_report(facts(folder, faults=[]))
    assert summary["collisions"] == 0
    assert summary["min_clearance_m"] == pytest.approx(1.9 - 0.85, abs=1e-3)
    assert summary["distance_m"] == pytest.approx(2.7 + 22 + 14 + 22 + 18 + 2.7 * 0.985, abs=0.1)


def test_the_recovery(whole):
    _, summary = whole
    assert summary["faults"] == ["zed@30"]
    assert summary["injected"] == [{"sensor": "zed", "mode": "dead", "t_s": 30.0}]
    moving_s = summary["recovery"].pop("moving_again_s")
    assert summary["recovery"] == {"failure_s": 30.0, "detected_s": 30.25, "fallback_running_s": 30.45}
    assert moving_s == pytest.approx(33.5, abs=0.16)  # the vehicle sets off at 33.4 s, the samples are 0.1 s apart


def test_the_map(whole):
    _, summary = whole
    assert summary["map"]["points"] == 400 * 300
    assert summary["map"]["rmse_m"] == pytest.approx(0.04, abs=0.002)
    # The wall is not in this map: of what is in reach it is that part which is missed.
    assert 0.8 < summary["map"]["coverage"] < 0.95


def test_skills_and_resources(whole):
    _, summary = whole
    assert [(s["skill"], s["outcome"], s["result"]) for s in summary["skills"]][:6] == [
        ("takeoff", "TERMINATED", "AT_ALTITUDE"),
        ("lidar_mapping", "INTERRUPTED", ""),
        ("zed_depthmap", "RESOURCE_INVARIANT_VIOLATED", "zed_works"),
        ("goto_straight", "TERMINATED", "ARRIVED"),
        ("goto_straight", "INTERRUPTED", ""),
        ("lidar_depthmap", "INTERRUPTED", ""),
    ]
    takeoff = summary["skills"][0]
    assert (takeoff["skillset"], takeoff["id"], takeoff["inputs"]) == ("navigation", "t1", {"height": 3.0, "speed": 2.0})
    assert (takeoff["start_s"], takeoff["running_s"], takeoff["end_s"]) == (-1.2, -1.18, 4.6)
    broken = [change for change in summary["resources"] if change["to"] == "BROKEN"]
    change = {"skillset": "perception", "resource": "zed_status", "from": "OK", "to": "BROKEN", "cause": "extern", "reason": ""}
    assert broken == [{"t_s": 30.25, **change}]


def test_the_files(whole):
    folder, summary = whole
    written = json.loads((folder / "summary.json").read_text())
    assert written == {**summary, "recovery": written["recovery"]}
    assert not [path.name for path in folder.iterdir() if path.name.startswith(".")]
    assert {path.name for path in folder.iterdir()} >= OUTPUTS
    picture = mpl_image.imread(folder / "map.png")
    assert picture.shape[0] > 400
    assert picture.shape[1] > 1000
    assert len(np.unique(picture[..., 0])) > 50, "many colours"


def test_the_timeline(whole):
    folder, _ = whole
    timeline = json.loads((folder / "timeline.json").read_text())
    assert [(row["skillset"], row["skill"], len(row["bars"])) for row in timeline["skills"]] == [
        ("navigation", "takeoff", 1),
        ("navigation", "goto_straight", 2),
        ("navigation", "rotate_head", 3),
        ("navigation", "lock_head", 3),
        ("navigation", "goto", 3),
        ("navigation", "land", 1),
        ("mapping", "lidar_mapping", 1),
        ("perception", "zed_depthmap", 1),
        ("perception", "lidar_depthmap", 1),
    ]
    endings = {(row["skill"], bar["id"]): bar["ending"] for row in timeline["skills"] for bar in row["bars"]}
    assert endings["zed_depthmap", "z1"] == "violated"
    assert (endings["goto_straight", "s1"], endings["goto_straight", "s2"]) == ("success", "interrupted")
    (zed,) = (row for row in timeline["resources"] if row["resource"] == "zed_status")
    assert [(band["state"], band["from_s"]) for band in zed["bands"]] == [("UNKNOWN", -3.0), ("OK", -3.0), ("BROKEN", 30.25)]
    assert [(mark["kind"], mark["t_s"]) for mark in timeline["marks"]][:3] == [("failure", 30.0), ("detected", 30.25), ("fallback", 30.45)]


def test_the_timeline_as_picture(whole):
    folder, _ = whole
    texts = [element.text for element in ET.parse(folder / "timeline.svg").getroot().iter("{http://www.w3.org/2000/svg}text")]  # noqa: S314
    for wanted in (
        "takeoff",
        "zed_depthmap",
        "lidar_depthmap",
        "zed_status",
        "BROKEN",
        "zed_works violated",
        "AT_ALTITUDE",
        "time since lift-off (s)",
    ):
        assert wanted in texts
    assert "zed fails, 30.00 s" in texts
    assert "invariant violated" in texts
    assert "failed or refused" not in texts, "the legend explains only what is there"


def test_the_summary_has_the_causes_that_the_page_shows(whole):
    folder, summary = whole
    (shown,) = [value for topic, _, value in read_report(folder / "report.html") if topic == CAUSES]
    assert summary["causes"] == json.loads((folder / "summary.json").read_text())["causes"] == shown
    assert "zed_depthmap" in [failure["skill"] for failure in shown["failures"]]


def test_the_same_folder_gives_the_same_files_again(whole):
    folder, _ = whole
    before = (folder / "timeline.svg").read_bytes(), (folder / "timeline.json").read_bytes()
    again = make_report(facts(folder))
    assert (again["problems"], again["landed"]) == ([], True)
    assert ((folder / "timeline.svg").read_bytes(), (folder / "timeline.json").read_bytes()) == before


def test_the_report_of_a_run_without_a_supervisor_is_a_command(folder, capsys):
    assert report.main([str(folder), "--scenario", "mapping", "--seed", "3", "--fail", "zed@30"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[1] == "mission accomplished in degraded mode: zed_depthmap: zed_works was violated"
    assert "zed failed at 30.00 s" in "".join(lines)
    assert json.loads((folder / "summary.json").read_text())["seed"] == 3


def test_an_empty_folder(tmp_path):
    summary = make_report(facts(tmp_path, faults=[], mission_exit=None))
    known = {"scenario", "seed", "map", "skills", "resources", "faults", "injected", "died", "lift_off", "problems"}
    known |= {"answers", "tasks", "causes"}
    assert {key for key, value in summary.items() if value is not None} == known
    assert summary["skills"] == summary["resources"] == []
    assert set(summary["map"].values()) == {None}
    for name in (RECORD, "functional.bag", "world.ply", "map.ply", "the mission's account", "bridge.json"):
        assert [problem for problem in summary["problems"] if name in problem], name
    assert {path.name for path in tmp_path.iterdir()} == OUTPUTS


def test_a_folder_that_has_gone_is_told_in_the_verdict(tmp_path):
    gone = tmp_path / "gone"
    summary = make_report(facts(gone, faults=[], mission_exit=0))
    assert "summary.json could not be written: No such file or directory" in summary["problems"]
    lines = verdict_lines(summary, [], gone)
    assert lines[1] == "mission accomplished (by its exit code; its own account is lost)"
    assert "  problem: summary.json could not be written: No such file or directory" in lines


def test_what_the_mission_could_not_record_is_a_problem_of_the_flight(folder):
    problem = "skills.mcap ends early: No space left on device"
    run_log.note(folder, run_log.MISSION, {"outcome": "degraded", "problems": [problem]})
    assert "skills.mcap ends early: No space left on device" in make_report(facts(folder))["problems"]


@pytest.mark.parametrize("content", [b"", b"\x00\xff\x80garbage", b"{", b"[]", b"null", b'"text"'], ids=repr)
def test_garbage_everywhere(tmp_path, content):
    (tmp_path / "logs").mkdir()
    for name in (RECORD, run_log.FILE, "functional.bag", "logs/bridge.json", "map.ply", "world.ply"):
        (tmp_path / name).write_bytes(content)
    summary = make_report(facts(tmp_path))
    assert summary["outcome"] is None
    assert summary["landed"] is None
    assert len(summary["problems"]) >= 6
    assert json.loads((tmp_path / "summary.json").read_text())["problems"] == summary["problems"]


@pytest.mark.parametrize("missing", [RECORD, run_log.FILE, "functional.bag", "logs/bridge.json", "map.ply", "world.ply"])
def test_each_file_may_be_missing(folder, missing):
    (folder / missing).unlink()
    summary = make_report(facts(folder))
    told = "the mission's account" if missing == run_log.FILE else Path(missing).name
    assert any(told in problem for problem in summary["problems"])
    unknown = {
        RECORD: summary["skills"] == [],
        run_log.FILE: summary["outcome"] is None and summary["map"]["coverage"] is None and summary["map"]["rmse_m"] is not None,
        "functional.bag": summary["min_clearance_m"] is None and summary["lift_off"]["source"] == "flight_status",
        "logs/bridge.json": summary["bridge"] is None,
        "map.ply": summary["map"]["points"] == 5 and summary["map"]["rmse_m"] is None,
        "world.ply": summary["min_clearance_m"] == 1.1 and summary["map"]["rmse_m"] is None,
    }
    assert unknown[missing]
    if missing != "functional.bag":
        assert (summary["landed"], summary["recovery"]["failure_s"]) == (True, 30.0)
    else:
        assert summary["recovery"] == {"failure_s": None, "detected_s": 30.25, "fallback_running_s": 30.45, "moving_again_s": None}


def test_that_a_deployment_records_nothing_is_no_problem(folder):
    (folder / "functional.bag").unlink()
    summary = make_report(facts(folder, recorded=False))
    assert [problem for problem in summary["problems"] if "functional.bag" in problem] == []
    assert (summary["min_clearance_m"], summary["lift_off"]["source"]) == (None, "flight_status")


def test_a_crash_in_flight(folder):
    t_s, position = poses()
    half = t_s < LIFT_OFF_S + 40.0
    (folder / "functional.bag").unlink()
    state = {"lift_off_s": LIFT_OFF_S, "collisions": 0, "min_clearance_m": None, "distance_m": 30.0, "faults": []}
    told = guidance(t_s[half])
    write_bag(folder / "functional.bag.active", poses=(t_s[half], position[half]), states=[state], guidance=told, cut_at=10**9)
    run_log.note(folder, run_log.MISSION, {"outcome": "running", "reason": ""})
    failing_flight().write(folder / RECORD, until_s=LIFT_OFF_S + 40.0)
    summary = make_report(facts(folder, mission_exit=None))
    assert (summary["outcome"], summary["reason"], summary["landed"]) == ("running", None, False)
    assert summary["duration_s"] == pytest.approx(40.0, abs=1.0)
    running = {s["skill"] for s in summary["skills"] if s["outcome"] == "RUNNING"}
    assert running == {"lidar_mapping", "lidar_depthmap", "lock_head", "goto"}
    assert summary["min_clearance_m"] == pytest.approx(1.05, abs=1e-3)
    assert "the fault zed@30 never happened" in summary["problems"]
    assert "the mission's process ended before the mission did" in summary["problems"]
    timeline = json.loads((folder / "timeline.json").read_text())
    assert [bar["ending"] for row in timeline["skills"] for bar in row["bars"] if row["skill"] == "goto"] == ["running"]


def test_nominal_has_no_recovery(tmp_path):
    log = Log()
    log.change(0.0, "navigation.flight_status", "ON_GROUND", "IN_AIR")
    log.skill(1.0, "navigation.goto_straight", "s1", "REQUESTED", inputs={"speed": math.nan})
    log.skill(1.0, "navigation.goto_straight", "s1", "NOT_READY", result="in_air", message="flight_status is ON_GROUND")
    log.write(tmp_path / RECORD)
    summary = make_report(facts(tmp_path, faults=[]))
    assert summary["recovery"] is None
    assert json.loads((tmp_path / "summary.json").read_text())["skills"][0]["inputs"] == {"speed": None}
    assert "failed or refused" in (tmp_path / "timeline.svg").read_text()


def test_nothing_is_said_to_have_landed_that_never_flew(folder):
    t_s, position = poses()
    ground = position * 0.0
    Log().write(folder / RECORD)
    states = [{"t_s": t, "reference": "idle", "landed_state": 1} for t in t_s]
    state = {"lift_off_s": None, "collisions": 0, "min_clearance_m": None, "distance_m": 0.0, "faults": []}
    write_bag(folder / "functional.bag", poses=(t_s, ground), states=[state], guidance=states)
    summary = make_report(facts(folder, faults=[], mission_exit=2))
    assert summary["landed"] is None
    assert "landed: no lift-off is known" in "\n".join(verdict_lines(summary, [], folder))


@pytest.mark.parametrize(
    ("last", "by_skills", "left"),
    [
        ({"landed_state": 2, "height_m": 3.04, "armed": True}, False, "still in the air, in BRAKE, at 3.0 m"),
        ({"landed_state": 2, "height_m": 3.04, "armed": True}, True, None),  # the recorder died before it came down
        ({"landed_state": 1, "armed": True}, True, "on the ground with its motors on, in BRAKE"),
        ({"landed_state": 1}, True, None),
    ],
)
def test_how_the_vehicle_is_left_is_told(folder, last, by_skills, left):
    (folder / "functional.bag").unlink()
    if not by_skills:
        (folder / RECORD).unlink()
    told = [{"t_s": LIFT_OFF_S + since_s, "landed_state": 2 if since_s > 0.0 else 1} for since_s in range(-3, 30)]
    state = {"lift_off_s": LIFT_OFF_S, "collisions": 0, "min_clearance_m": 1.1, "distance_m": 83.0, "faults": []}
    write_bag(folder / "functional.bag", states=[state], guidance=[*told, {"t_s": LIFT_OFF_S + 30.0, "mode": "BRAKE", **last}])
    summary = make_report(facts(folder))
    assert (summary["landed"], summary["left"]) == (by_skills, left)


def test_a_guidance_that_died_is_not_believed_for_long(folder):
    (folder / RECORD).unlink()
    told = [{"t_s": LIFT_OFF_S + since_s, "landed_state": 2 if since_s > 0.0 else 1} for since_s in range(-3, 12)]
    t_s, position = poses()
    assert t_s[-1] - told[-1]["t_s"] > 10.0
    state = {"lift_off_s": LIFT_OFF_S, "collisions": 0, "min_clearance_m": 1.1, "distance_m": 83.0, "faults": []}
    last = {**told[-1], "mode": "LAND", "height_m": 2.2}
    write_bag(folder / "functional.bag", poses=(t_s, position), states=[state], guidance=[*told[:-1], last])
    unheard_s = t_s[-1] - last["t_s"]
    said = f"still in the air, in LAND, at 2.2 m, as the guidance said last, {unheard_s:.0f} s before the end"
    assert make_report(facts(folder))["left"] == said


def test_a_recording_that_broke_off_before_the_lift_off_says_nothing_of_a_landing(folder):
    log = Log()
    log.change(0.0, "navigation.flight_status", "ON_GROUND", "IN_AIR")
    log.write(folder / RECORD)
    t_s, position = poses()
    before = t_s < LIFT_OFF_S - 0.1
    states = [{"t_s": t, "reference": "idle", "landed_state": 1} for t in t_s[before]]
    write_bag(folder / "functional.bag", poses=(t_s[before], position[before]), guidance=states)
    assert make_report(facts(folder, faults=[], mission_exit=1))["landed"] is False


def test_a_vehicle_that_lies_is_not_believed(folder):
    t_s, position = poses()
    position[t_s > LIFT_OFF_S + 60.0, 2] = 3.0
    write_bag(folder / "functional.bag", poses=(t_s, position), guidance=guidance(t_s))
    summary = make_report(facts(folder))
    assert summary["landed"] is False
    assert "the vehicle is said to be on the ground, its true path ends otherwise" in summary["problems"]


@pytest.mark.parametrize("told", ["it met the ground at 7.6 m/s", ""])
def test_a_vehicle_that_fell_has_not_landed(folder, told):
    t_s, position = poses()
    since_s = t_s - LIFT_OFF_S
    position[:, 2] = np.where(since_s > LANDING_S, np.maximum(3.0 - 4.903 * (since_s - LANDING_S) ** 2, 0.3), position[:, 2])
    state = {"lift_off_s": LIFT_OFF_S, "collisions": 1, "crash": told, "min_clearance_m": 1.0, "distance_m": 80.0, "faults": []}
    write_bag(folder / "functional.bag", poses=(t_s, position), states=[state], guidance=guidance(t_s))
    summary = make_report(facts(folder, faults=[]))
    assert (summary["landed"], summary["collisions"], summary["problems"]) == (False, 1, [])
    assert summary["crash"].startswith(told or "it met the ground at ")
    assert f"landed: no, it crashed: {summary['crash']}" in "\n".join(verdict_lines(summary, [], folder))
