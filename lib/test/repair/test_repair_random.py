"""Repairs of random missions of random robots: attacked in flights, and what is called impossible by brute force."""

from __future__ import annotations

import random
from collections import Counter
from collections.abc import Iterator, Mapping
from itertools import permutations
from pathlib import Path

import pytest

pytest.importorskip("z3")
pytest.importorskip("py_trees")

from repair_robots import robot_of
from repair_worlds import GOOD, Brute, Sky

from alula.language.syntax.properties import property_of_mission
from alula.model.expressions import Expression
from alula.model.model import Property, Skill
from alula.prove.limits import Deadline
from alula.prove.mission.wanted import PROPERTY
from alula.repair.errors import RepairError
from alula.repair.game import played
from alula.repair.judging import Judge
from alula.repair.repairing import Answer, Question, Search
from alula.repair.subject import Subject

TIME_S = 600.0
"""What a search may take: it ends by its result, also on a busy machine."""
QUICK = range(12)


def quiet(_line: str) -> None:
    """Take no notice."""


def answers(seed: int, folder: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[Subject, str, Answer]]:
    """Yield what comes of asking for each fault of a random robot that ends a skill of its mission."""
    monkeypatch.setenv("ALULA_ROBOT", str(folder))
    subject = Subject.read(robot_of(random.Random(seed), folder), quiet)  # noqa: S311 - for tests
    for fault in subject.faults:
        try:
            yield subject, fault, Search(subject, Question(fault), Deadline.after(TIME_S), quiet).run()
        except RepairError as error:
            assert "no skill of the mission ends by it" in str(error)  # noqa: PT017 - of a fault that is none of this mission


def properties(text: str) -> Mapping[str, Expression]:
    """Return what must never be, by the names of a mission's properties."""
    several = (property_of_mission(match["text"], "the end") for match in PROPERTY.finditer(text))
    return {one.name: one.condition for one in several if isinstance(one, Property)}


def attack_repair(subject: Subject, answer: Answer, flights: range) -> Counter[str]:
    """Fly a repaired mission with each fault that it is said to survive, at each moment, and with all that can fail."""
    repair, told = answer.repair, Counter[str]()
    assert repair is not None
    path = subject.path.with_name("repaired.xml")
    path.write_text(repair.text)
    left = {one for one in properties(repair.text) if any(f"`{one}`" in line for line in repair.left)}
    sky = Sky(path, subject.skillsets, subject.faults, {name: one for name, one in properties(repair.text).items() if name not in left})
    for faults, fate in repair.after.items():
        for seed in flights if fate.survives else ():
            chance = random.Random(f"{seed} {faults}")  # noqa: S311 - for tests
            for at_s in sky.moments(seed):
                moments = [at_s, *(at_s + chance.uniform(0.0, 4.0) for _ in faults[1:])]
                outcome = sky.with_faults(dict(zip(faults, moments, strict=True)), seed)
                assert outcome in GOOD, f"{faults} from {moments} s on, {seed}"
                told["with faults"] += 1
    for seed in flights:
        assert sky.with_anything(seed) == []
        told["with anything"] += 1
    return told


def attack_impossible(subject: Subject, answer: Answer) -> None:
    """Have no skill for the same purpose run by brute force, nor the mission be accomplished without it."""
    shown = []
    for failing in answer.failing:
        skillset, _, name = failing.skill.partition(".")
        (model,) = [one for one in subject.skillsets if one.name == skillset]
        fault = frozenset((at.partition(".")[2], state) for at, state in failing.states if at.startswith(f"{skillset}."))
        alike = [one.name for one in model.skills if is_alike(one, model.skill(name))]
        shown.append(fault and not any(Brute(model, fault).can_run(one) for one in alike))
    assert any(shown)
    sky = Sky(subject.path, subject.skillsets, subject.faults)
    for seed in range(3):
        mission = sky.without_faults(seed)
        if mission.outcome in GOOD:
            assert {failing.skill for failing in answer.failing} & {f"{one.skillset}.{one.skill}" for one in mission.executions}


def is_alike(one: Skill, other: Skill) -> bool:
    """Return whether a skill may do what another one does: it comes to an end as that one does, with the same inputs."""
    return [ports.name for ports in one.inputs] == [ports.name for ports in other.inputs] and one.results == other.results


def attacked(seed: int, folder: Path, monkeypatch: pytest.MonkeyPatch, flights: range) -> Counter[str]:
    """Attack all answers of a random robot; return how many of which kind there were."""
    told = Counter[str]()
    for subject, _, answer in answers(seed, folder, monkeypatch):
        if answer.repair is not None:
            told += attack_repair(subject, answer, flights) + Counter(["repaired"])
        if answer.impossible:
            attack_impossible(subject, answer)
            told["impossible"] += 1
    return told


def test_what_is_repaired_holds_out_and_what_is_impossible_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    told = Counter[str]()
    for seed in QUICK:
        told += attacked(seed, tmp_path / str(seed), monkeypatch, range(2))
    assert told["repaired"] >= 3
    assert told["impossible"] >= 3
    assert told["with faults"] >= 40


def test_a_fault_that_shows_in_a_state_leaves_another_all_its_strikes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Robot 95: a sensor is lost, and then a skill ends badly as often as faults may come."""
    assert attacked(95, tmp_path, monkeypatch, range(3))["with faults"] > 0


def test_a_skill_without_inputs_may_stand_for_another_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Robot 189: no branch is made of it, but that is not impossible."""
    (answer,) = [one for _, fault, one in answers(189, tmp_path, monkeypatch) if fault == "motor"]
    assert not answer.impossible


@pytest.mark.long
@pytest.mark.timeout(0)  # 2.3 s of processor time for each: as long as the machine needs
def test_twenty_more_do(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    told = Counter[str]()
    for seed in range(len(QUICK), len(QUICK) + 20):
        told += attacked(seed, tmp_path / str(seed), monkeypatch, range(6))
    assert told["repaired"] >= 4
    assert told["impossible"] >= 4


@pytest.mark.parametrize("seed", QUICK)
def test_what_becomes_of_a_mission_does_not_hang_on_the_faults_that_were_looked_at_before(
    seed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ALULA_ROBOT", str(tmp_path))
    subject = Subject.read(robot_of(random.Random(seed), tmp_path), quiet)  # noqa: S311 - for tests
    judge, text = Judge(subject, Deadline.after(TIME_S, quiet)), subject.path.read_text()
    of_all = judge.fates(text)
    for faults in [(), *((one,) for one in subject.faults), *permutations(subject.faults, 2)]:
        assert of_all(faults, None) == judge.fate(text, faults)


@pytest.mark.parametrize("seed", QUICK)
def test_a_skill_is_said_to_be_able_to_run_exactly_where_brute_force_can_run_it(
    seed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ALULA_ROBOT", str(tmp_path))
    subject = Subject.read(robot_of(random.Random(seed), tmp_path), quiet)  # noqa: S311 - for tests
    told = Counter[bool]()
    for model in subject.skillsets:
        for resource in model.resources:
            for state in {one.target for one in resource.transitions if one.extern}:
                for skill in model.skills:
                    ours = played(model, skill.name, [(resource.name, state)], Deadline.after(TIME_S)).won
                    assert ours == Brute(model, frozenset({(resource.name, state)})).can_run(skill.name), (resource.name, state, skill.name)
                    told[ours] += 1
    assert len(told) == 2
