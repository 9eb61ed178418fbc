"""The missions as files: what they tell, what is wrong in them is told, and a change of one is flown."""

from __future__ import annotations

import dataclasses
import json
import subprocess
import sys

import pytest

from alula.campaign.mocked_scenarios import load_mocked_scenario
from alula.common.robots import find_robot
from alula.missions.director import Outcome
from alula.missions.plan import InputError
from alula.missions.scenario import inputs_of, plan_of


def test_a_file_tells_its_parameters_and_what_is_told_of_it():
    told = load_mocked_scenario("mapping").plan
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
    flights = load_mocked_scenario(name)
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
        ('target="{waypoint}"', 'target="1;2;3"', "a Point comes from an entry"),
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
    flights = dataclasses.replace(load_mocked_scenario("inspection"), scenario=scenario)
    plan = plan_of(scenario, inputs_of(scenario))
    assert plan.parameters["takeoff_height_m"] == 4.5
    assert flights.run().end.outcome is Outcome.ACCOMPLISHED


def command(name, *words):
    """Return what a command writes to the standard output; it has to end with 0, and to say on standard error how far it is at most."""
    root = find_robot().root
    ended = subprocess.run([sys.executable, "-m", f"alula.cli.{name}", *words], cwd=root, capture_output=True, text=True, check=False)
    said = [line for line in ended.stderr.splitlines() if "looking at its runs" not in line]
    assert (ended.returncode, said) == (0, []), ended.stdout
    return ended.stdout


@pytest.mark.long
def test_the_checker_finds_nothing_in_the_drones_missions_which_keep_the_axes_as_listing_3_does():
    names = ["missions/mapping.xml", "missions/inspection.xml"]
    files = json.loads(command("check", "--time", "600", "--json", *names))["files"]
    # All of their runs are looked at; what is found is accepted in the file, which is a note.
    found = {one["file"]: [(finding["code"], finding["severity"]) for finding in one["findings"]] for one in files}
    assert found == {name: [("ALU701", "note")] for name in names}
    for one in files:
        (finding,) = one["findings"]
        assert "`navigation.land`" in finding["message"]
        assert "axes_authority == USED" in finding["message"]


def test_a_mission_is_drawn_with_the_drones_own_nodes(tmp_path):
    text = command("tree", "missions/mapping.xml", "--svg", str(tmp_path / "m.svg"))
    for node in ("waypoint writer (uav.NextWaypoint)", "until the route is flown (Until)", "take off (takeoff)"):
        assert node in text
    assert "until the route is flown" in (tmp_path / "m.svg").read_text()
