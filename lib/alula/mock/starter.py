"""Make a behaviour file to start from: the default behaviour of the mocks, with alternatives in comments."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from alula.mock.behaviour import DEFAULT_DELAY_S, default_script
from alula.model.model import Resource, Skill, Skillset


def starter(skillsets: Sequence[Skillset]) -> str:
    """Return a behaviour file of which every line does something, and every extern transition has its line."""
    lines = ["skills:"]
    for skillset in skillsets:
        for skill in skillset.skills:
            lines += _skill(skillset.name, skill)
    transitions = [line for skillset in skillsets for resource in skillset.resources for line in _resource(skillset.name, resource)]
    if transitions:
        lines += ["", "# What the functional layer reports, in seconds after the start.", "timeline:", *transitions]
    return "\n".join(lines) + "\n"


def _skill(skillset: str, skill: Skill) -> Iterable[str]:
    ending = default_script(skill).ending
    inputs = ", ".join(parameter.name for parameter in skill.inputs) or "none"
    yield f"  # inputs: {inputs}; results: {', '.join(result.name for result in skill.results) or 'none'}"
    what = f"delay: {DEFAULT_DELAY_S:g}, result: {ending.results[0][0]}" if ending.results else "never: true"
    yield f"  {skillset}.{skill.name}: {{{what}}}"


def _resource(skillset: str, resource: Resource) -> Iterable[str]:
    """Yield one line with the first extern transition from the initial state, if there is one."""
    transitions = [transition for transition in resource.transitions if transition.extern]
    first = next((transition for transition in transitions if transition.source == resource.initial), None)
    if first is not None:
        known = ", ".join(f"{transition.source} -> {transition.target}" for transition in transitions)
        yield f"  # {known}"
        yield f"  - {{after: {DEFAULT_DELAY_S:g}, set: {{{skillset}.{resource.name}: {first.target}}}}}"
