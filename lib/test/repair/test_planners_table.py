"""What planners are asked for beside `alula plan`: PDDL of a small robot's models, and what may go otherwise in a plan of them."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

pytest.importorskip("z3")
pytest.importorskip("py_trees")

from repair_rovers import ERRAND, rover

from alula.repair.courses import Here, initial_states
from alula.repair.purposes import Purposes
from alula.repair.repairing import condition_of
from alula.repair.subject import Subject
from planners_table.cases import Case, beginning, otherwise
from planners_table.pddl import CLASSICAL, RESULTS, TEMPORAL, Models, names


@pytest.fixture
def subject(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Subject:
    monkeypatch.setenv("ALULA_ROBOT", str(tmp_path))
    return Subject.read(rover(tmp_path, ERRAND.replace("PORTS", "")), print)


@pytest.fixture
def models(subject: Subject) -> Models:
    return Models(Purposes(subject.skillsets, subject.brought))


def action(text: str, name: str) -> str:
    """Return an action of a domain, in one line."""
    (found,) = re.findall(rf"\(:(?:durative-)?action {name}\n.*?(?=\n\(:|\n\)\Z)", text.rstrip(), re.DOTALL)
    return " ".join(found.split())


def test_a_skill_is_an_action_with_what_its_success_brings_about(subject: Subject, models: Models) -> None:
    text = models.text(CLASSICAL, Here(initial_states(subject.skillsets, ())), condition_of("--goal", "base.place == DOCKED"))
    dock = action(text.domain, "base-dock")
    assert ":precondition (and (base-wheels-free) (base-pose-good) (filled-sight))" in dock
    assert "(base-place-docked) (not (base-place-away))" in dock
    assert "(power-charger-on)" in dock  # which its mock brings about
    assert "(filled-sight)" in action(text.domain, "start-eyes-scan")
    assert "(not (filled-sight))" in action(text.domain, "end-eyes-scan")
    assert "(:goal (base-place-docked))" in text.problem
    assert "(eyes-laser-ok)" in text.problem


def test_invariants_and_roles_hold_over_all_of_a_durative_action(subject: Subject, models: Models) -> None:
    text = models.text(TEMPORAL, Here(initial_states(subject.skillsets, ())), "arrival")
    assert "(over all (eyes-laser-ok))" in action(text.domain, "eyes-scan")
    drive = action(text.domain, "base-drive")
    assert "(over all (filled-sight))" in drive
    assert "(at start (base-wheels-used)) (at start (not (base-wheels-free)))" in drive
    assert "(at end (base-wheels-free))" in drive
    assert "(:goal (done-arrival))" in text.problem


def test_each_result_is_an_effect_that_the_world_may_choose(subject: Subject, models: Models) -> None:
    text = models.text(RESULTS, Here(initial_states(subject.skillsets, ())), "arrival")
    drive = action(text.domain, "base-drive")
    assert drive.count("oneof") == 1
    assert drive.count("(done-arrival)") == 1  # of two results


def test_what_pddl_does_not_say_is_told(subject: Subject, models: Models) -> None:
    models.text(TEMPORAL, Here(initial_states(subject.skillsets, ())), "arrival")
    assert models.left_out == {"data of power.supply, invariant", "data of power.supply, precondition"}


def test_names_of_actions_are_those_of_skills(models: Models) -> None:
    known = names(models.purposes)
    assert known["start-eyes-scan"] == known["eyes-scan"] == "eyes.scan"


def test_each_step_of_a_plan_may_end_otherwise_and_lose_what_it_holds(subject: Subject, models: Models) -> None:
    here = beginning(Case("base.place == DOCKED", "base.place == AWAY and base.pose == LOST"), subject)
    assert here.states["base.pose"] == "LOST"
    found = list(otherwise(["base.turn", "eyes.scan", "base.dock"], here, models.purposes))
    assert [(one.what, one.is_result) for one in found] == [
        ("base.turn ends LOST", True),
        ("base.dock ends BLOCKED", True),
        ("eyes.laser BROKEN in base.dock", False),
    ]
    assert [one.here.states["base.pose"] for one in found] == ["LOST", "GOOD", "GOOD"]
    assert found[2].here.states["eyes.laser"] == "BROKEN"
