"""The model of a robot from trees: its skillset, the types, what its mocks do."""

from __future__ import annotations

from collections.abc import Mapping

from alula.adopt.entries import Entries
from alula.adopt.vocabulary import FAILS, HOLDS, ResourceOf, SkillOf, Vocabulary
from alula.language.printer import print_skillset
from alula.model.model import Parameter, Resource, Result, ResultKind, Skill, Skillset, Transition

DONE, FAILED = "SUCCESS", "FAILURE"
"""Results of a skill, as an action answers."""


def model_text(vocabulary: Vocabulary, entries: Entries) -> str:
    """Return the file of the skillset."""
    resources = tuple(map(_resource, vocabulary.resources.values()))
    skills = tuple(_skill(one, entries) for one in vocabulary.skills.values())
    comments = {f"  skill {one.name} {{": one.type for one in vocabulary.skills.values()}
    lines = ["// What the trees ask of the robot. What they don't tell, such as resources that skills take, is to be added: README.md.", ""]
    for line in print_skillset(Skillset(vocabulary.robot, resources=resources, skills=skills)).splitlines():
        if (kind := comments.get(line)) is not None:
            lines.append(f"  // {kind.name}{f': {in_a_line(kind.doc)}' if kind.doc else ''}")
        lines.append(line)
    return "\n".join([*lines, ""])


def types_text(vocabulary: Vocabulary, entries: Entries) -> str:
    """Return the file that says what types are in ROS."""
    skills = vocabulary.skills.values()
    used = {entries.type(one.name, name) for one in skills for name in (*one.inputs.values(), *one.outputs.values())}
    lines = [f"{kind}: {kind}" for kind in sorted(used)] or ["{}"]
    return "\n".join(["# What the types of the model are in ROS; a message is one as Pose: geometry_msgs/Pose", *lines, ""])


def mocks_text(vocabulary: Vocabulary, states: Mapping[str, str]) -> str:
    """Return the file of the mocks: each skill succeeds, each resource is in its state of ``states``; a fault has it do otherwise."""
    robot, skills = vocabulary.robot, [one.name for one in vocabulary.skills.values()]
    holding = [name for name, state in states.items() if state == HOLDS]
    lines = ["# What the robot does in a mock. Weights make chances of a result: {SUCCESS: 9, FAILURE: 1}", "skills:"]
    lines += [f"  {robot}.{name}: {{delay: 1, result: {DONE}}}" for name in skills]
    lines += ["", "timeline:", *(f"  - {{after: 0, set: {{{robot}.{name}: {HOLDS}}}}}" for name in holding)] if holding else []
    lines += ["", "# Of a run: --fail NAME@SECONDS", "faults:"]
    lines += [f"  {name}: {{ends: {{{robot}.{name}: {FAILED}}}}}" for name in skills]
    lines += [f"  {name}: {{set: {{{robot}.{name}: {FAILS if name in holding else HOLDS}}}}}" for name in states]
    return "\n".join([*lines, ""])


def faults_text(vocabulary: Vocabulary, states: Mapping[str, str]) -> str:
    """Return the file that says what a fault brings about, for reports; ``states`` as for `mocks_text`."""
    robot = vocabulary.robot
    lines = ["# What a fault brings about before the mission responds; reports and campaigns credit a failure to a fault by it.", "faults:"]
    lines += [f"  {one.name}: {{ends: {{{robot}.{one.name}: {FAILED}}}}}" for one in vocabulary.skills.values()]
    lines += [f"  {name}: {{states: {{{robot}.{name}: {FAILS if state == HOLDS else HOLDS}}}}}" for name, state in states.items()]
    return "\n".join([*lines, ""])


def in_a_line(text: str) -> str:
    """Return a text without its line ends."""
    return " ".join(text.split())


def _resource(one: ResourceOf) -> Resource:
    transitions = (Transition(FAILS, HOLDS, extern=True), Transition(HOLDS, FAILS, extern=True))
    return Resource(one.name, (FAILS, HOLDS), FAILS, transitions)


def _skill(one: SkillOf, entries: Entries) -> Skill:
    def parameters(names: Mapping[str, str]) -> tuple[Parameter, ...]:
        told = [(one.type.ports[port].doc, name, entries.type(one.name, name)) for port, name in names.items()]
        return tuple(Parameter(name, kind, comment=in_a_line(doc)) for doc, name, kind in told)

    results = (Result(DONE, ResultKind.SUCCESS), Result(FAILED, ResultKind.FAILURE))
    return Skill(one.name, inputs=parameters(one.inputs), outputs=parameters(one.outputs), results=results)
