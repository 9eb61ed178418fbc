"""The missions as files decide as the trees in Python that they were made of: the same events, over mocks that fail."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest

from alula.campaign.mock_flights import load_flights
from alula.common.faults import parse_fault
from alula.common.robots import find_robot
from alula.missions.director import Outcome
from alula.missions.plan import InputError, inputs_of, plan_of

TROUBLES = Path(__file__).with_name("uav_missions_troubles.yaml")
CASES = [
    ("mapping", ""),
    ("mapping", "zed@30"),
    ("mapping", "zed@30 lidar@60"),
    ("mapping", "lidar@20"),
    ("inspection", ""),
    ("inspection", "radio:out@30"),
    ("inspection", "lidar@30"),
    ("inspection", "encoder:killed@30"),
    ("inspection", "control:lost@40"),
    ("inspection", "ground_station:killed@30"),
]


def events(flown):
    """Return what happened, without the ids of executions."""
    return [{key: value for key, value in dataclasses.asdict(event).items() if key != "id"} for event in flown.events]


def both(name, behaviour=()):
    """Return the flights of a mission in Python, and of the same as a file."""
    flights = load_flights(name, behaviour)
    made = [
        dataclasses.replace(flights, scenario=dataclasses.replace(flights.scenario, mission=mission))
        for mission in (f"uav_missions.{name}:plan", f"missions/{name}.xml")
    ]
    return made[0], made[1]


@pytest.mark.parametrize(("name", "words"), CASES)
def test_a_flight_with_faults_is_decided_as_in_python(name, words):
    faults = [parse_fault(word) for word in words.split()]
    python, filed = (flights.fly(faults) for flights in both(name))
    assert events(filed) == events(python)
    assert (filed.end.outcome, filed.notes, filed.open) == (python.end.outcome, python.notes, python.open)


@pytest.mark.parametrize("name", ["mapping", "inspection"])
def test_bad_days_are_decided_as_in_python(name):
    python, filed = both(name, [TROUBLES])
    outcomes = set()
    for seed in range(6):
        flown, expected = filed.fly(seed=seed), python.fly(seed=seed)
        assert events(flown) == events(expected), seed
        assert flown.end.outcome is expected.end.outcome
        outcomes.add(flown.end.outcome)
    assert len(outcomes) > 1


def test_a_file_tells_its_parameters_and_what_is_told_of_it():
    told = both("mapping")[1].plan()
    assert told.parameters["takeoff_height_m"] == 3.0
    assert told.facts() == {"waypoints": 0.0, "waypoints_reached": 0.0}
    assert told.skillsets == ("navigation", "perception", "mapping")


def changed(name, tmp_path, old, new):
    """Return the scenario with its file changed."""
    folder = find_robot().root / "missions"
    text = (folder / f"{name}.xml").read_text(encoding="utf-8")
    assert old in text
    for part in folder.glob("*.xml"):
        (tmp_path / part.name).write_text(part.read_text(encoding="utf-8"), encoding="utf-8")
    (tmp_path / f"{name}.xml").write_text(text.replace(old, new), encoding="utf-8")
    flights = load_flights(name)
    return dataclasses.replace(flights.scenario, mission=str(tmp_path / f"{name}.xml")), flights.inputs


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "<navigation.takeoff",
            "<navigation.takeof",
            r"mapping.xml:\d+:\d+: unknown node 'navigation.takeof'; did you mean",
        ),
        ('height="{takeoff_height_m}"', "", r"mapping.xml:\d+:\d+: 'navigation.takeoff' needs the port 'height'; add height="),
        ('height="{takeoff_height_m}"', 'height="three"', "the port 'height': 'three' is no double"),
        ('target="{waypoint}"', 'target="1;2;3"', "name an entry that has one"),
        ('name="route"', 'name="way"', "the mission needs `way` of its world"),
        ('default="3.0"', 'default="high"', "the default of the mission's port 'takeoff_height_m' is 'high', no number"),
    ],
)
def test_what_is_wrong_in_a_mission_is_told_before_it_begins(old, new, message, tmp_path):
    scenario, inputs = changed("mapping", tmp_path, old, new)
    with pytest.raises(InputError, match=message):
        plan_of(scenario, inputs)


def test_a_change_of_the_file_is_flown(tmp_path):
    """A newcomer's change: fly higher, and hover for longer."""
    scenario, _ = changed("inspection", tmp_path, 'name="takeoff_height_m" default="3.0"', 'name="takeoff_height_m" default="4.5"')
    flights = dataclasses.replace(load_flights("inspection"), scenario=scenario)
    plan = plan_of(scenario, inputs_of(scenario))
    assert plan.parameters["takeoff_height_m"] == 4.5
    assert flights.fly().end.outcome is Outcome.ACCOMPLISHED
