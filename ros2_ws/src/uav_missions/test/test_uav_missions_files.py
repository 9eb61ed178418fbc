"""The missions as files: what they tell, what is wrong in them is told, and a change of one is flown."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from alula import AlulaError, Mission, Outcome, Severity, check_files
from uav_missions.nodes import PART

ROOT = Path(__file__).resolve().parents[4]


def test_a_file_tells_its_parameters_and_what_is_told_of_it():
    told = Mission.load("mapping").plan
    assert told.parameters["takeoff_height_m"] == 3.0
    assert told.facts() == {"waypoints": 0.0, "waypoints_reached": 0.0}
    assert told.skillsets == ("navigation", "perception", "mapping")


def changed(name, tmp_path, old, new):
    """Return the mission with its file changed; raises what the mission does."""
    text = (ROOT / f"missions/{name}.xml").read_text(encoding="utf-8")
    assert old in text
    for part in (ROOT / "missions").glob("*.xml"):
        (tmp_path / part.name).write_text(part.read_text(encoding="utf-8"), encoding="utf-8")
    (tmp_path / f"{name}.xml").write_text(text.replace(old, new), encoding="utf-8")
    own = Mission.load(name)
    return Mission.from_file(tmp_path / f"{name}.xml", own.skillsets, behaviour=own.behaviour, nodes=PART.nodes, inputs=own.plan.inputs)


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
    with pytest.raises(AlulaError, match=message):
        changed("mapping", tmp_path, old, new)


def test_a_change_of_the_file_is_flown(tmp_path):
    """A newcomer's change: fly higher, and hover for longer."""
    higher = changed("inspection", tmp_path, 'name="takeoff_height_m" default="3.0"', 'name="takeoff_height_m" default="4.5"')
    assert higher.plan.parameters["takeoff_height_m"] == 4.5
    flown = higher.run()
    assert flown.outcome is Outcome.ACCOMPLISHED
    assert next(one.inputs for one in flown.executions if one.skill == "takeoff").height == 4.5


@pytest.mark.long
def test_the_checker_finds_nothing_in_the_drones_missions_which_keep_the_axes_as_listing_3_does():
    names = ["missions/mapping.xml", "missions/inspection.xml"]
    # All of their runs are looked at; what is found is accepted in the file, which is a note.
    for name in names:
        (finding,) = check_files(ROOT / name, robot=ROOT, timeout_s=600.0)
        assert (finding.code, finding.severity) == ("ALU701", Severity.NOTE)
        assert "`navigation.land`" in finding.message
        assert "axes_authority == USED" in finding.message


def test_a_mission_is_drawn_with_the_drones_own_nodes(tmp_path):
    words = ["tree", str(ROOT / "missions/mapping.xml"), "--svg", str(tmp_path / "m.svg")]
    text = subprocess.run([sys.executable, "-m", "alula.cli", *words], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    for node in ("waypoint writer (uav.NextWaypoint)", "until the route is flown (Until)", "take off (takeoff)"):
        assert node in text
    assert "until the route is flown" in (tmp_path / "m.svg").read_text()
