"""The drone's models: the listings of the paper in them, and the resources that nodes of the functional layer report."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest
from test_language_listings import LISTING_2, LISTING_3, TAKEOFF, wrapped

from alula.language.load import check_file, load_robot
from alula.language.paper import parse
from alula.language.printer import print_skillset
from alula.model.expressions import ResourceIs
from alula.model.json_form import from_json, to_json
from alula.model.model import Effect, Interrupt, ResultKind, Skill

SKILLSETS = next(parent / "skillsets" for parent in Path(__file__).resolve().parents if (parent / "skillsets").is_dir())
MODELS = sorted((SKILLSETS / "uav").glob("*.skill"))


@pytest.fixture(scope="module")
def robot():
    return load_robot(SKILLSETS / "uav")


@pytest.fixture(scope="module")
def navigation(robot):
    return next(s for s in robot.skillsets if s.name == "navigation")


@pytest.mark.parametrize("path", MODELS, ids=lambda path: path.stem)
def test_no_findings_and_round_trips(path):
    skillset, findings = check_file(path)
    assert findings == []
    assert parse(print_skillset(skillset)) == skillset
    assert from_json(to_json(skillset)) == skillset


def test_listing_3_is_in_it_as_printed(navigation):
    assert replace(navigation.skill("takeoff"), interrupt=Interrupt()) == TAKEOFF
    printed = (SKILLSETS / "uav" / "navigation.skill").read_text()
    tokens = re.sub(r"//[^\n]*|\s", "", printed)
    inner = re.sub(r"//[^\n]*|\s", "", LISTING_3)
    start, _, end = inner.partition("result{")
    assert start in tokens
    assert "result{" + end in tokens


def test_listings_1_and_2(navigation):
    assert navigation.resource("axes_authority") == wrapped(LISTING_2).resource("axes_authority")
    authority = navigation.resource("SDK_authority")
    assert authority.initial == "UNAVAILABLE"
    assert {(t.source, t.target, t.extern) for t in authority.transitions} == {
        ("UNAVAILABLE", "AVAILABLE", True),
        ("AVAILABLE", "UNAVAILABLE", True),
    }


SLAM = ("UNKNOWN", "OK", "LOST")
STATUS = [("UNKNOWN", "OK"), ("UNKNOWN", "BROKEN"), ("OK", "UNKNOWN"), ("OK", "BROKEN"), ("BROKEN", "OK"), ("BROKEN", "UNKNOWN")]
LINK = [("UNKNOWN", "UP"), ("UNKNOWN", "DOWN"), ("UP", "DOWN"), ("DOWN", "UP"), ("UP", "UNKNOWN"), ("DOWN", "UNKNOWN")]
"""The last two are of its silence."""


@pytest.mark.parametrize(
    ("skillset", "resource", "states", "extern", "internal"),
    [
        ("navigation", "heading_authority", ("AVAILABLE", "USED"), [], [("AVAILABLE", "USED"), ("USED", "AVAILABLE")]),
        ("navigation", "flight_status", ("ON_GROUND", "IN_AIR"), [("ON_GROUND", "IN_AIR"), ("IN_AIR", "ON_GROUND")], []),
        ("navigation", "homepoint_status", ("INVALID", "VALID"), [("INVALID", "VALID"), ("VALID", "INVALID")], []),
        ("navigation", "position_status", ("KNOWN", "LOST"), [("KNOWN", "LOST"), ("LOST", "KNOWN")], []),
        ("navigation", "link", ("UNKNOWN", "UP", "DOWN"), LINK, []),
        ("mapping", "imu_status", ("OK", "BROKEN"), [("OK", "BROKEN")], [("BROKEN", "OK")]),
        ("perception", "zed_status", ("UNKNOWN", "OK", "BROKEN"), STATUS, []),
        ("perception", "lidar_status", ("UNKNOWN", "OK", "BROKEN"), STATUS, []),
        ("mapping", "mapping_process", ("IDLE", "RUNNING"), [], [("IDLE", "RUNNING"), ("RUNNING", "IDLE")]),
        (
            "mapping",
            "height_status",
            ("AGREED", "DRIFTING", "WRONG"),
            [("AGREED", "DRIFTING"), ("AGREED", "WRONG"), ("DRIFTING", "WRONG"), ("DRIFTING", "AGREED")],
            [("DRIFTING", "AGREED"), ("WRONG", "AGREED")],
        ),
        ("mapping", "slam_status", ("UNKNOWN", "OK", "LOST"), [(a, b) for a in SLAM for b in SLAM if a != b], []),
    ],
)
def test_resources(robot, skillset, resource, states, extern, internal):
    found = next(s for s in robot.skillsets if s.name == skillset).resource(resource)
    assert found.states == states
    assert found.initial == states[0]
    assert sorted((t.source, t.target) for t in found.transitions if t.extern) == sorted(extern)
    assert sorted((t.source, t.target) for t in found.transitions if not t.extern) == sorted(internal)


SKILLS = {
    "navigation": {
        "takeoff": ({"height": "float64", "speed": "float64"}, ["AT_ALTITUDE", "BLOCKED", "ABORTED"]),
        "goto": ({"target": "Point", "speed": "float64"}, ["ARRIVED", "BLOCKED", "ABORTED"]),
        "goto_straight": ({"target": "Point", "speed": "float64"}, ["ARRIVED", "BLOCKED", "ABORTED"]),
        "rotate_head": ({"heading": "float64", "rate": "float64"}, ["ALIGNED", "BLOCKED", "ABORTED"]),
        "lock_head": ({"heading": "float64"}, ["UNLOCKED", "ABORTED"]),
        "hover": ({"duration": "float64"}, ["DONE", "ABORTED"]),
        "land": ({}, ["LANDED", "BLOCKED", "ABORTED"]),
    },
    "perception": {"zed_depthmap": ({}, ["LOST", "ABORTED"]), "lidar_depthmap": ({}, ["LOST", "ABORTED"])},
    "mapping": {"lidar_mapping": ({}, ["ABORTED"])},
    "video": {"stream": ({"min_fps": "float64", "min_quality": "float64", "patience": "float64"}, ["LOST", "ABORTED"])},
}


def test_skills(robot):
    found = {
        skillset.name: {s.name: ({p.name: p.type for p in s.inputs}, [r.name for r in s.results]) for s in skillset.skills}
        for skillset in robot.skillsets
    }
    assert found == SKILLS


def after(states: dict[str, str], effect: Effect) -> dict[str, str]:
    return states | {change.resource: change.target for change in effect.assignments}


def endings(skill: Skill) -> dict[str, Effect]:
    return {r.name: r.effect for r in skill.results} | {i.name: i.effect for i in skill.invariants} | {"interrupt": skill.interrupt.effect}


def test_whatever_ends_a_skill_it_gives_back_what_it_took(robot):
    """Except takeoff by Listing 3's `violation=reset`, and what an invariant says is not held any more."""
    kept = {}
    for skillset in robot.skillsets:
        free = {resource.name: resource.initial for resource in skillset.resources if not all(t.extern for t in resource.transitions)}
        for skill in skillset.skills:
            running = after(free, skill.start)
            for name, effect in endings(skill).items():
                broken = next((i.condition for i in skill.invariants if i.name == name), None)
                lost = {broken.resource} if isinstance(broken, ResourceIs) and broken.resource in free else set()
                end = {resource: state for resource, state in after(running, effect).items() if resource not in lost}
                if any(state != free[resource] for resource, state in end.items()):
                    kept[f"{skill.name}.{name}"] = sorted(r for r, state in end.items() if state != free[r])
    assert kept == {"takeoff.keep_sdk_authority": ["axes_authority"]}


def test_landing_asks_for_little_and_survives_touching_the_ground(navigation):
    land = navigation.skill("land")
    asked = {p.condition.resource: p.condition.state for p in land.preconditions}
    assert asked == {"SDK_authority": "AVAILABLE", "axes_authority": "AVAILABLE", "flight_status": "IN_AIR"}
    assert all(i.condition.resource != "flight_status" for i in land.invariants)


def test_every_motion_skill_ends_when_the_pilot_takes_over(navigation):
    for skill in navigation.skills:
        assert ResourceIs("SDK_authority", "AVAILABLE") in [i.condition for i in skill.invariants]
        assert ResourceIs("SDK_authority", "AVAILABLE") in [p.condition for p in skill.preconditions]


def test_a_broken_camera_breaks_the_invariant_zed_ok(robot):
    perception = next(s for s in robot.skillsets if s.name == "perception")
    (zed,) = perception.skill("zed_depthmap").invariants
    (lidar,) = perception.skill("lidar_depthmap").invariants
    assert (zed.name, zed.condition) == ("zed_ok", ResourceIs("zed_status", "OK"))
    assert (lidar.name, lidar.condition) == ("lidar_ok", ResourceIs("lidar_status", "OK"))


@pytest.mark.parametrize("path", MODELS, ids=lambda path: path.stem)
def test_every_result_is_a_success_or_a_failure(path):
    skills = check_file(path)[0].skills
    assert [(skill.name, one.name) for skill in skills for one in skill.results if skill.kind_of(one.name) is ResultKind.PLAIN] == []
