"""What the report says of the radio that ended a flight's video."""

from __future__ import annotations

from pathlib import Path

import pytest

from alula.common.faults import FaultChange
from alula.common.scenarios import load_scenario
from alula.records.causes.alarms import Alarms
from alula.records.causes.fault_file import effects_of_robot
from alula.records.causes.faults import Fault
from alula.report.facts import RunFacts
from alula.report.history import History
from alula.report.observed import Observed
from alula.report.phases import Phases
from alula.report.recovery import find_recovery
from alula.report.responses import find_responses, known_faults
from alula.report.timeline import make_timeline
from uav_report.flight import RADIO, explains
from uav_report.phases import FlightPhases
from uav_report.video import RadioState, Video, radio_lost_s

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
    assert radio_lost_s(video, FlightPhases(zero_s=LIFT_OFF_S, zero_from="simulator")) == lost_s


def test_a_stream_that_no_criterion_ended_lost_no_radio():
    assert radio_lost_s(Video(radio=(RadioState(1.0, "out", "", 0.0),), end_s=22.0), FlightPhases()) is None


@pytest.mark.parametrize(("killed_s", "failure_s", "failed"), [(110.0, 110.0, "ground_station"), (None, 112.5, "radio")])
def test_a_process_that_died_is_not_told_as_the_radio(killed_s, failure_s, failed):
    killed = () if killed_s is None else (FaultChange("ground_station", "killed", killed_s),)
    scenario, observed, facts = load_scenario("inspection"), Observed(processes=killed), RunFacts("inspection", 0, Path(), (), (), None)
    effects = effects_of_robot()
    known = known_faults(facts, scenario, History(), observed, Phases(), effects)
    if not any(explains(fault, 112.5, effects.of(RADIO)) for _, fault in known):
        known.append((FaultChange(RADIO, "", 112.5), Fault(RADIO, 112.5, effects=effects.of(RADIO))))
    recovery = find_recovery(scenario, History(), observed, Phases(), find_responses(known, History()), Alarms())
    assert (recovery.failure_s, recovery.failed) == (failure_s, failed)
    (mark,) = make_timeline(History(), Phases(zero_s=100.0, zero_from="simulator"), recovery, Alarms())["marks"]
    assert (mark["t_s"], mark["label"]) == (failure_s - 100.0, f"{failed} fails")
