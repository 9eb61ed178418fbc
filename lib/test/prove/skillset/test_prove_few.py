"""Counterexamples that a few skills make: those that the search of all situations finds, too, and also where all skills are too many."""

from __future__ import annotations

import random
from dataclasses import replace

import pytest

from alula.model.expressions import And, Not, ResourceIs, SkillRuns
from alula.model.model import Property, PropertyKind, Skillset
from alula.prove.limits import Deadline
from alula.prove.skillset import few
from alula.prove.skillset.abstract import without_data
from alula.prove.skillset.prover import prove
from prove_bench.skillsets import neighbours, sparse, tools

HANGS_S = 600.0
ALL_ONE_BY_ONE = 10**6


def wanted(skillset: Skillset, seed: int) -> tuple[Property, ...]:
    """Return properties of each kind over random skills and resources."""
    chance = random.Random(seed)  # noqa: S311 - nothing here is secret
    found = []
    for kind in PropertyKind:
        skill, resource = chance.choice(skillset.skills), chance.choice(skillset.resources)
        used = ResourceIs(resource.name, resource.states[-1])
        condition = And((SkillRuns(skill.name), used if chance.random() < 0.5 else Not(used)))
        then = ResourceIs(chance.choice(skillset.resources).name, "Used") if kind is PropertyKind.LEADS_TO else None
        found.append(Property(f"{kind.name.lower()}", kind, condition, then, fair=chance.random() < 0.5 and then is not None))
    return tuple(found)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("family", [sparse, neighbours, tools])
def test_what_a_few_skills_refute_is_what_the_search_of_all_situations_refutes(family, seed) -> None:
    skillset = family(4 + seed % 2)
    skillset = replace(skillset, properties=wanted(skillset, seed))
    deadline = Deadline.after(HANGS_S)
    refuted = few.refuted(without_data(skillset, deadline), skillset.properties, deadline, copies=2)
    all_found = {finding.message for finding in prove(skillset, timeout_s=HANGS_S, most=ALL_ONE_BY_ONE) if finding.code == "ALU531"}
    names = {wanted.name for wanted in skillset.properties if any(f"property `{wanted.name}` " in message for message in all_found)}
    assert set(refuted) == names
    assert all(finding.counterexample is not None for finding in refuted.values())


def test_a_property_that_does_not_hold_is_told_with_its_run_among_200_skills() -> None:
    skillset = sparse(200)
    both = Property("apart", PropertyKind.NEVER, And((SkillRuns("use0"), SkillRuns("use1"))))
    back = Property("back", PropertyKind.LEADS_TO, SkillRuns("use0"), ResourceIs("part7", "Used"), fair=True)
    alone = skillset.properties[0]
    deadline = Deadline.after(HANGS_S)
    refuted = few.refuted(without_data(skillset, deadline), (both, back, alone), deadline, copies=2)
    assert set(refuted) == {"apart", "back"}
    run = refuted["apart"].counterexample
    assert run is not None
    assert {step.text for step in run.steps if "use" in step.text}
