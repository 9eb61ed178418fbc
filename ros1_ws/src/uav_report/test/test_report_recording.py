"""The bag: whole, cut off in the middle of anything, or not there at all."""

from __future__ import annotations

import math
import sys
from pathlib import Path

import numpy as np
import pytest

from alula.common import run_log
from alula.common.faults import FaultChange
from alula.common.scenarios import load_scenario
from alula.report.facts import RunFacts
from alula.report.files import Problems
from alula.report.history import History
from alula.report.making import fault_entries
from alula.report.page.entries import FAULT, HEALTH, PATH, TOLD
from alula.report.part import ReportedRun
from uav_report.flight import FlightReport
from uav_report.page import page_entries
from uav_report.recording import read_recording

sys.path.insert(0, str(Path(__file__).parent))
from test_report_sample import path_through, write_bag

from alula_testing.run_log import LIFT_OFF_S

STRAIGHT = path_through([(0, 0, 3), (20, 0, 3)], speed_m_s=2.0, start_s=LIFT_OFF_S)
STATE = {"t_s": 20.0, "lift_off_s": LIFT_OFF_S, "collisions": 0, "min_clearance_m": 1.25, "distance_m": 20.0, "faults": []}


def test_a_whole_bag(tmp_path):
    fault = {"sensor": "zed", "mode": "dead", "t_s": LIFT_OFF_S + 5.0}
    guidance = [{"t_s": LIFT_OFF_S + 1.0, "reference": "land", "landed_state": 2}]
    write_bag(tmp_path / "functional.bag", poses=STRAIGHT, states=[{**STATE, "faults": [fault]}], guidance=guidance, map_points=77)
    problems = Problems()
    recording = read_recording(tmp_path, problems)
    assert problems.sentences == []
    np.testing.assert_allclose(recording.truth.t_s, STRAIGHT[0], atol=1e-6)
    np.testing.assert_allclose(recording.truth.position_enu_m, STRAIGHT[1])
    assert recording.truth.length_m() == pytest.approx(20.0)
    np.testing.assert_allclose(recording.truth.horizontal_speed_m_s(), 2.0, atol=1e-6)
    assert recording.simulator.faults == (FaultChange("zed", "dead", LIFT_OFF_S + 5.0),)
    assert (recording.simulator.min_clearance_m, recording.simulator.collisions) == (1.25, 0)
    assert recording.guidance[0].landing
    assert recording.map_points == 77


def test_what_the_page_is_told_of_the_bag(tmp_path):
    health = [(LIFT_OFF_S + t_s / 10, "silent" if t_s >= 53 else "") for t_s in range(100)]
    write_bag(tmp_path / "functional.bag", poses=STRAIGHT, states=[STATE], health=health)
    entries = list(page_entries(read_recording(tmp_path, Problems()), None))
    path = [(t_s, place) for topic, t_s, place in entries if topic == PATH]
    assert len(path) == pytest.approx(5 * 10.0, abs=2)
    assert path[-1][1] == pytest.approx([20.0, 0.0, 3.0], abs=0.5)
    assert [entry for entry in entries if entry[0] != PATH] == [
        (HEALTH, LIFT_OFF_S, {"sensor": "zed", "ok": True, "fault": "", "reason": ""}),
        (HEALTH, LIFT_OFF_S + 5.3, {"sensor": "zed", "ok": False, "fault": "silent", "reason": "it is silent"}),
    ]


def test_the_page_is_told_of_sensors_and_processes_that_were_made_to_fail_in_the_order_of_time(tmp_path):
    faults = [{"sensor": "zed", "mode": mode, "t_s": LIFT_OFF_S + t_s} for mode, t_s in (("dark", 3.0), ("ok", 7.0))]
    write_bag(tmp_path / "functional.bag", poses=STRAIGHT, states=[{**STATE, "faults": faults}])
    run_log.note(tmp_path, run_log.FAULT, {"sensor": "encoder", "mode": "killed", "t_s": LIFT_OFF_S + 5.0})
    run = ReportedRun(RunFacts("mapping", 0, tmp_path, (), (), None), load_scenario("mapping"), History(), Problems())
    entries = fault_entries(FlightReport(run).observe(run))
    told = [(t_s - LIFT_OFF_S, value["sensor"], value["mode"]) for topic, t_s, value in entries if topic == FAULT]
    assert told == [(3.0, "zed", "dark"), (5.0, "encoder", "killed"), (7.0, "zed", "ok")]


def test_the_page_is_told_what_the_autopilot_told_once_in_ten_seconds(tmp_path):
    texts = ((4.0, "autopilot: A"), (5.0, "autopilot: B"), (6.0, "autopilot: A"), (17.0, "autopilot: A"))
    said = [(LIFT_OFF_S + t_s, words) for t_s, words in texts]
    write_bag(tmp_path / "functional.bag", poses=STRAIGHT, states=[STATE], told=said)
    entries = page_entries(read_recording(tmp_path, Problems()), None)
    assert [(round(t_s - LIFT_OFF_S, 3), value["words"]) for topic, t_s, value in entries if topic == TOLD] == [
        (4.0, "autopilot: A"),
        (5.0, "autopilot: B"),
        (17.0, "autopilot: A"),
    ]


def test_the_last_whole_state_of_the_simulator_counts(tmp_path):
    texts = [STATE, '{"t_s": 20.0, "lift_off_s": 12.0, "collisions": 2, "min_clearance_m": Infinity, "faults": null}', "{cut"]
    write_bag(tmp_path / "functional.bag", poses=STRAIGHT, states=texts)
    problems = Problems()
    simulator = read_recording(tmp_path, problems).simulator
    assert (simulator.collisions, simulator.min_clearance_m, simulator.distance_m, simulator.faults) == (2, None, None, ())
    assert problems.sentences == ["/sim/state held a message that is no JSON"]


def test_poses_that_are_no_numbers_or_come_twice_are_left_out(tmp_path):
    t_s = np.array([3.0, 1.0, 1.0, 2.0])
    positions = np.array([[3.0, 0, 0], [1.0, 0, 0], [9.0, 0, 0], [math.nan, 0, 0]])
    write_bag(tmp_path / "functional.bag", poses=(t_s, positions))
    truth = read_recording(tmp_path, Problems()).truth
    np.testing.assert_allclose(truth.t_s, [1.0, 3.0])
    np.testing.assert_allclose(truth.position_enu_m[:, 0], [1.0, 3.0])


def test_no_bag(tmp_path):
    problems = Problems()
    assert read_recording(tmp_path, problems).path is None
    assert problems.sentences == ["functional.bag is missing: nothing is known of the vehicle's true path"]


@pytest.mark.parametrize("name", ["functional.bag.active", "functional.bag"])
def test_a_killed_recorder_costs_only_the_last_chunk(tmp_path, name):
    write_bag(tmp_path / "whole.bag", poses=STRAIGHT, states=[STATE], cut_at=10**9)
    size = (tmp_path / "whole.bag").stat().st_size
    write_bag(tmp_path / name, poses=STRAIGHT, states=[STATE], cut_at=size * 3 // 4)
    before = (tmp_path / name).read_bytes()
    problems = Problems()
    truth = read_recording(tmp_path, problems).truth
    # Chunks of 4 kB hold 19 poses or so: a second of flight at 20 Hz.
    assert 0.6 * len(STRAIGHT[0]) < len(truth.t_s) < 0.8 * len(STRAIGHT[0])
    np.testing.assert_allclose(truth.t_s, STRAIGHT[0][: len(truth.t_s)], atol=1e-6)
    assert problems.sentences == [f"{name} was cut off; functional.bag holds what could be recovered of it"]
    if name.endswith(".active"):
        assert (tmp_path / name).read_bytes() == before, "the original stays as it was"
    again = Problems()
    assert len(read_recording(tmp_path, again).truth.t_s) == len(truth.t_s)
    assert again.sentences == []


def test_a_bag_cut_at_any_place_is_no_traceback(tmp_path):
    write_bag(tmp_path / "whole.bag", poses=STRAIGHT, states=[STATE], cut_at=10**9)
    whole = (tmp_path / "whole.bag").read_bytes()
    seen = []
    for cut in [0, 1, 13, 40, 4095, 4096, 4200, *range(5000, len(whole), 1777), len(whole) - 1]:
        folder = tmp_path / str(cut)
        folder.mkdir()
        (folder / "functional.bag.active").write_bytes(whole[:cut])
        problems = Problems()
        truth = read_recording(folder, problems).truth
        seen.append(0 if truth is None else len(truth.t_s))
        assert len(problems.sentences) == 1
        assert problems.sentences[0].startswith("functional.bag.active was cut off")
        assert (folder / "functional.bag").exists() == bool(seen[-1])
        assert not list(folder.glob(".*")), "nothing half made is left"
    assert seen == sorted(seen)
    assert seen[0] == 0
    assert seen[-1] > 0.8 * len(STRAIGHT[0])


def test_garbage_is_no_bag(tmp_path):
    (tmp_path / "functional.bag").write_bytes(b"not a bag at all" * 1000)
    problems = Problems()
    assert read_recording(tmp_path, problems).truth is None
    assert problems.sentences[0].startswith("functional.bag was cut off and nothing could be recovered of it")
