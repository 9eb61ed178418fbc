"""The resources that a mission can depend on: those that its trees name, and those that the models' skills, events or properties do.

Any other may change at any time and nothing is different then; with twenty of them a search would see a million situations for each.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace

from alula.missions.mission_file import MissionFile
from alula.model.expressions import TRUE
from alula.model.json_form import to_json
from alula.model.model import Skillset
from alula.prove.mission.conditions import Faults
from alula.trees.access import takes_script_from_entry
from alula.trees.attributes import type_name
from alula.trees.reading import TreeFiles
from alula.trees.registry import NodeRegistry

WORD = re.compile(r"\w+")
ANYTHING = "*"
"""In a state that shows a fault."""


def with_asked_resources(file: MissionFile, faults: Faults) -> tuple[Skillset, ...]:
    """Return the models of a mission without the resources that nothing names; a state that the trees name keeps a resource that has it."""
    files, models, registry = file.files, file.skillsets, file.registry
    if any(takes_script_from_entry(one, registry.get(type_name(one))) for tree in files.trees.values() for one in tree.iterate()):
        return models  # the script may come from outside, and name any of them
    words = {word for text in _texts(files, registry) for word in WORD.findall(text)}
    shown = [state for name, states in faults.items() if name in words for state in states]
    if any(ANYTHING in state for state in shown):
        return models
    words |= {word for state in shown for word in WORD.findall(state)}
    asked = {one.name: words | set(WORD.findall(to_json(_steps_of(one)))) for one in models}
    kept = {(one.name, resource.name) for one in models for resource in one.resources if resource.name in asked[one.name]}
    states = {state for one in models for resource in one.resources if (one.name, resource.name) in kept for state in resource.states}
    for one in models:
        for resource in one.resources:
            if not states.issuperset(words.intersection(resource.states)):
                kept.add((one.name, resource.name))
                states.update(resource.states)
    return tuple(replace(one, resources=tuple(each for each in one.resources if (one.name, each.name) in kept)) for one in models)


def _steps_of(model: Skillset) -> Skillset:
    """Return what steps are taken by: what a skill is for changes none."""
    return replace(model, resources=(), skills=tuple(replace(one, provides=(), needs=(), achieves=TRUE) for one in model.skills))


def _texts(files: TreeFiles, registry: NodeRegistry) -> Iterator[str]:
    """Yield all texts in which a mission can name a resource."""
    for tree in files.trees.values():
        for element in tree.iterate():
            yield type_name(element)
            yield from (one.value for one in element.attributes.values())
    for kind in registry:
        yield from (port.default for port in kind.ports.values() if port.default)
