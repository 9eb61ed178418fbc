"""What the report says of the radio that ended a flight's video."""

from __future__ import annotations

from pathlib import Path

import pytest

from alula.common.faults import FaultChange
from alula.common.scenarios import load_scenario
from alula.records.causes.fault_file import reaches_of_robot
from alula_flight.report.answers import find_answers
from alula_flight.report.events import History
from alula_flight.report.facts import RunFacts
from alula_flight.report.phases import Phases
from alula_flight.report.recording import Recording
from alula_flight.report.recovery import find_recovery
from alula_flight.report.timeline import make_timeline
from alula_flight.report.video import RadioState, Video, radio_lost_s

LIFT_OFF_S = 100.0


@pytest.mark.parametrize(
    ("states", "lost_s"),
    [
        ([("good", -5.0), ("critical", 17.0)], 117.0),
        ([("good", -5.0), ("degraded", 8.0), ("critical", 17.0), ("out", 20.0), ("critical", 21.0)], 117.0),
        ([("good", -5.0), ("critical", 10.0), ("good", 12.0), ("out", 18.0)], 118.0),
        ([("good", -5.0), ("critical", 10.0), ("good", 12.0)], None),
        ([("good", -5.0), ("critical", 30.0)], None),
        ([], None),
    ],
)
def test_the_radio_was_lost_when_it_became_as_bad_as_it_was_in_the_end(states, lost_s):
    radio = tuple(RadioState(t_s, quality, "", 0.0) for quality, t_s in states)
    video = Video(radio=radio, end_s=22.0, criterion="enough_frames")
    assert radio_lost_s(video, Phases(zero_s=LIFT_OFF_S, zero_from="simulator")) == lost_s


def test_a_stream_that_no_criterion_ended_lost_no_radio():
    assert radio_lost_s(Video(radio=(RadioState(1.0, "out", "", 0.0),), end_s=22.0), Phases()) is None


@pytest.mark.parametrize(("killed_s", "failure_s", "failed"), [(110.0, 110.0, "ground_station"), (None, 112.5, "radio")])
def test_a_process_that_died_is_not_told_as_the_radio(killed_s, failure_s, failed):
    killed = () if killed_s is None else (FaultChange("ground_station", "killed", killed_s),)
    scenario, recording, facts = load_scenario("inspection"), Recording(processes=killed), RunFacts("inspection", 0, Path(), (), (), None)
    answers = find_answers(facts, scenario, History(), recording, Phases(), reaches_of_robot(), radio_lost_s=112.5)
    recovery = find_recovery(scenario, History(), recording, Phases(), answers)
    assert (recovery.failure_s, recovery.failed) == (failure_s, failed)
    (mark,) = make_timeline(History(), Phases(zero_s=100.0, zero_from="simulator"), recovery)["marks"]
    assert (mark["t_s"], mark["label"]) == (failure_s - 100.0, f"{failed} fails")
