"""Check the fields that a skillset's conditions ask of its data against the definitions of the ROS messages."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain
from pathlib import Path

from alula.common.robots import RobotError, find_robot
from alula.language.check.references import error
from alula.language.errors import Diagnostic
from alula.language.messages import FieldError, Messages, messages_of
from alula.language.models import ModelFile
from alula.model.expressions import DataIs, atoms
from alula.model.model import Skillset
from alula.model.ros_types import PRIMITIVES


def check_fields(file: ModelFile) -> None:
    """Add findings about fields of messages to a robot's model; a file outside of a robot's folder of models is not checked."""
    folder = Path(file.path).parent
    try:
        robot = find_robot(folder)
    except (RobotError, OSError):
        return
    if robot.skillsets.resolve() == folder.resolve():
        messages = messages_of(robot)
        file.add(finding for skillset in file.skillsets for finding in field_findings(skillset, messages))


def field_findings(skillset: Skillset, messages: Messages) -> Iterator[Diagnostic]:
    """Yield a finding for each field that a message does not have, and for each value that is none of the field's type."""
    skills = skillset.skills
    conditions = [one.condition for skill in skills for one in skill.preconditions]
    conditions += [one.condition for skill in skills for one in skill.invariants]
    for atom in chain.from_iterable(atoms(condition) for condition in conditions):
        data = skillset.data_index.get(atom.data) if isinstance(atom, DataIs) else None
        if data is None or data.type in PRIMITIVES or not isinstance(atom, DataIs):
            continue
        name = ".".join((atom.data, *atom.path))
        try:
            field = messages.field(data.type, atom.path)
        except FieldError as wrong:
            yield error("ALU214", f"data `{name}`: {wrong}", atom.span, hint=wrong.cure)
            continue
        if field is None:
            continue
        python = PRIMITIVES.get(field.interface)
        if python is None:
            yield error("ALU214", f"data `{name}` is a {field.interface}, no single value", atom.span, hint=f"name a field: `{name}.FIELD`")
        elif (python in {"int", "float"}) != isinstance(atom.value, float) or (python == "str") != isinstance(atom.value, str):
            yield error("ALU214", f"data `{name}` is a {field.interface} and can't be compared with {atom.value!r}", atom.span)
