"""The missions over mocks: in one process, in virtual time."""

from __future__ import annotations

from pathlib import Path

import pytest
from alula import Mission, Outcome

ROOT = Path(__file__).resolve().parents[1]


def drive(scenario, *faults, behaviour="", tmp_path=None):
    """Run a mission; return it, its end, what ended how, in order: (skill, result or state), and what it tells."""
    files = []
    if behaviour:
        files.append(tmp_path / "more.yaml")
        files[-1].write_text(behaviour, encoding="utf-8")
    mission = Mission.load(scenario, ROOT, behaviour=files).run(*faults)
    assert mission.open_executions == []
    assert mission.notes == []
    return mission, mission.end, [(one.skill, one.result or one.state.value) for one in mission.ended], mission.facts


def test_three_parcels_are_delivered_and_it_is_home_again():
    mission, end, ended, facts = drive("deliver")
    assert end.outcome is Outcome.ACCOMPLISHED
    assert facts["delivered"] == 3
    assert [one for one in ended if one[0] in {"load", "unload"}] == [("load", "LOADED"), ("unload", "UNLOADED")] * 3
    assert mission.state("base", "base_status") == "DOCKED"


def test_the_laser_dies_and_it_creeps_to_the_safe_place():
    mission, end, ended, _ = drive("deliver", "laser@20")
    assert end.outcome is Outcome.DEGRADED
    after = ended[ended.index(("scan", "works")) :]
    assert ("creep", "ARRIVED") in after
    assert not [one for one in after if one == ("drive_to", "ARRIVED")]
    assert mission.state("base", "wheels") == "FREE"


def test_without_laser_and_bumper_it_stops_and_calls():
    _, end, ended, _ = drive("deliver", "bumper@10", "laser@20")
    assert end.outcome is Outcome.GIVEN_UP
    assert ("creep", "ARRIVED") not in ended
    assert ended[-2:] == [("stop_here", "STANDING"), ("ask", "ANSWERED")]


@pytest.mark.parametrize("scenario", ["deliver", "patrol"])
def test_the_battery_fails_and_it_charges_and_goes_on_where_it_was(scenario):
    _, end, ended, facts = drive(scenario, "battery@30")
    assert end.outcome is Outcome.DEGRADED
    at = ended.index(("supply", "FAILING"))
    assert ("dock", "DOCKED") in ended[at:]
    assert ("charge", "CHARGED") in ended[at:]
    if scenario == "deliver":
        assert facts["delivered"] == 3
        assert ended.count(("load", "LOADED")) == 3


def test_below_15_percent_it_charges(tmp_path):
    low = "data: {power.battery: {value: {percentage: 'level if t < 40 or level > 0.9 else 0.149'}}}"
    _, end, ended, facts = drive("deliver", behaviour=low, tmp_path=tmp_path)
    assert ("supply", "enough") in ended
    assert ("charge", "CHARGED") in ended
    assert (end.outcome, facts["delivered"]) == (Outcome.DEGRADED, 3)


def test_lost_it_stops_and_turns_until_it_knows():
    _, end, ended, facts = drive("deliver", "pose@20-25")
    at = ended.index(("drive_to", "keeps_pose"))
    order = [one for one in ended[at:] if one[0] in {"stop_here", "localise"}]
    assert order == [("stop_here", "STANDING"), ("localise", "FOUND")]
    assert (end.outcome, facts["delivered"]) == (Outcome.DEGRADED, 3)


def test_when_turning_does_not_help_it_calls_for_help():
    _, end, ended, _ = drive("deliver", "pose@20")
    at = ended.index(("drive_to", "keeps_pose"))
    assert [one[0] for one in ended[at:] if one[0] in {"localise", "ask"}] == ["localise"] * 3 + ["ask", "localise", "ask"]
    assert end.outcome is Outcome.GIVEN_UP


@pytest.mark.parametrize("scenario", ["deliver", "patrol"])
@pytest.mark.parametrize("fault", ["link", "link:silent"])
def test_a_lost_link_is_waited_for_and_the_work_goes_on(scenario, fault):
    mission, end, ended, facts = drive(scenario, f"{fault}@20-50")
    assert end.outcome is Outcome.DEGRADED
    stopped = [number for number, one in enumerate(ended) if one[1] == "keeps_link"]
    assert len(stopped) == 1, "it asks for no motion before the link is back"
    assert [one for one in ended[stopped[0] :] if one[0] == "ask"] == [], "nobody is asked to let it past"
    assert mission.state("base", "base_status") == "DOCKED"
    if scenario == "deliver":
        assert facts["delivered"] == 3
    else:
        assert facts["rounds_done"] == 2


def test_a_link_that_stays_away_ends_the_mission_with_that_cause():
    mission, end, ended, _ = drive("patrol", "link@20")
    assert end.outcome is Outcome.GIVEN_UP
    assert "keeps_link" in end.reason
    assert mission.state("base", "wheels") == "FREE"
    assert [one for one in ended if one[1] in {"keeps_link", "linked"}] == [("follow_corridor", "keeps_link")]


def test_a_door_that_stays_shut_has_it_take_the_other_way(tmp_path):
    shut = "skills: {cargo.open_door: [{when: door == 'kitchen', result: SHUT}]}"
    _, end, ended, facts = drive("deliver", behaviour=shut, tmp_path=tmp_path)
    assert facts["delivered"] == 3
    assert end.outcome is Outcome.ACCOMPLISHED
    assert ("open_door", "SHUT") in ended


def test_a_room_that_can_not_be_reached_costs_its_parcels_only(tmp_path):
    shut = "skills: {cargo.open_door: [{when: door == 'workshop', result: SHUT}]}"
    mission, end, ended, facts = drive("deliver", behaviour=shut, tmp_path=tmp_path)
    assert (end.outcome, facts["delivered"], facts["handled"]) == (Outcome.DEGRADED, 1, 3)
    assert mission.state("cargo", "box") == "EMPTY"
    assert ended.count(("unload", "UNLOADED")) == 2  # one of them back at its sender


def test_who_stands_in_the_way_home_is_asked_to_let_it_past(tmp_path):
    blocked = "memory: {tries: 0}\nskills: {base.dock: [{when: tries < 1, delay: 15, result: BLOCKED, moves: {tries: tries + 1}}]}"
    _, end, ended, _ = drive("patrol", behaviour=blocked, tmp_path=tmp_path)
    assert end.outcome is Outcome.ACCOMPLISHED
    home = [one for one in ended if one[0] in {"dock", "ask"}]
    assert home == [("dock", "BLOCKED"), ("ask", "ANSWERED"), ("dock", "DOCKED")]


@pytest.mark.parametrize("fault", ["person@5", "navigation@5", "bridge@2"])
def test_what_passes_is_waited_for(fault):
    _, end, _, facts = drive("deliver", fault)
    assert (end.outcome, facts["delivered"]) == (Outcome.ACCOMPLISHED, 3)


def test_the_patrol_follows_the_corridor():
    _, end, ended, _ = drive("patrol")
    assert end.outcome is Outcome.ACCOMPLISHED
    assert ended.count(("follow_corridor", "ARRIVED")) == 4
