"""The module `<skillset>_managers.client`: a skillset's skills, resources and data with types, for its callers."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from alula.generate.client_templates import CLIENT, SKILL
from alula.generate.python_code import WIDTH, annotation, keyword_only, message_imports, tidy, wrapped
from alula.generate.text import comment, fill, header, lines, packages
from alula.language.reserved_names import CLIENT as CLIENT_ATTRIBUTES
from alula.language.reserved_names import Attributes
from alula.language.robot import Robot
from alula.model.model import Data, Parameter, Resource, Skill, Skillset
from alula.model.ros_types import PRIMITIVES, RosType, camel

VECTORS = (RosType("geometry_msgs", "Point"), RosType("geometry_msgs", "Vector3"), RosType("geometry_msgs", "Point32"))
"""Messages that may also be given as three numbers."""


def client_module(robot: Robot, skillset: Skillset) -> str:
    """Return ``client.py``: a class a skill, one for the data, one for the skillset."""
    return tidy(
        fill(
            CLIENT,
            skillset=skillset.name,
            camel=camel(skillset.name),
            header=header(robot, skillset),
            typing=_typing(robot, skillset),
            imports=_checking(robot, skillset),
            states="\n".join(_states(resource) for resource in skillset.resources),
            skills="\n".join(_skill(robot, skill) for skill in skillset.skills),
            data=lines((_data(robot, data) for data in skillset.data), 8) or "        pass",
            members=lines(_members(skillset), 8),
        )
    )


def attribute_names(skillset: Skillset) -> tuple[dict[str, str], dict[str, str]]:
    """Return the attribute of each skill and of each resource by its name."""
    attributes = Attributes(CLIENT_ATTRIBUTES)
    skills = {skill.name: attributes.add(skill.name) for skill in skillset.skills}
    return skills, {resource.name: attributes.add(resource.name) for resource in skillset.resources}


def _imports(robot: Robot, skillset: Skillset) -> list[str]:
    parameters = [p for skill in skillset.skills for p in (*skill.inputs, *skill.outputs)]
    of_data = packages(robot.message(data) for data in skillset.data if data.type not in PRIMITIVES)
    return sorted({*message_imports(robot, parameters), *(f"import {package}.msg" for package in of_data)})


def _typing(robot: Robot, skillset: Skillset) -> str:
    wanted = {
        "TYPE_CHECKING": bool(_checking(robot, skillset)),
        "Literal": bool(skillset.resources or skillset.skills),
        "TypedDict": bool(skillset.skills),
    }
    names = [name for name, needed in wanted.items() if needed]
    return f"from typing import {', '.join(names)}\n" if names else ""


def _checking(robot: Robot, skillset: Skillset) -> str:
    """Return the imports that only annotations need."""
    vectors = any(robot.ros_type(p.type) in VECTORS for skill in skillset.skills for p in skill.inputs)
    rows = ["from collections.abc import Sequence", ""] if vectors else []
    rows += _imports(robot, skillset)
    return "\nif TYPE_CHECKING:\n" + lines(rows, 4) + "\n" if rows else ""


def _skill(robot: Robot, skill: Skill) -> str:
    name = camel(skill.name)
    parameters = [f"{p.name}: {_input_annotation(robot, p)}" for p in skill.inputs]
    return fill(
        SKILL,
        camel=name,
        skill=skill.name,
        result_type=_literal(f"{name}Result", (result.name for result in skill.results)),
        outputs="".join(f"\n    {p.name}: {annotation(robot, p)}{comment(p.comment)}" for p in skill.outputs) + "\n",
        results=_results(skill),
        definition=wrapped("def __call__", ["self", *keyword_only(parameters)], f" -> Handle[{name}Outputs, {name}Result]:", indent=4),
        arguments=_arguments(robot, skill.inputs),
        start=_start(skill),
    ).rstrip("\n")


def _start(skill: Skill) -> str:
    pairs = [f'"{p.name}": {p.name}' for p in skill.inputs]
    one = f"        return self.start({{{', '.join(pairs)}}})"
    if len(one) <= WIDTH:
        return one
    return "        return self.start(\n" + wrapped("", pairs, "", indent=12, brackets="{}") + "\n        )"


def _arguments(robot: Robot, inputs: Iterable[Parameter]) -> str:
    """Return the docstring's part on the inputs: type, and what the model says of it (a unit, a limit)."""
    rows = [f"{p.name}: {robot.ros_type(p.type).interface}{_said(p.comment)}" for p in inputs]
    return "\n" + lines(["Args:"], 8) + "\n" + lines(rows, 12) + "\n" if rows else ""


def _input_annotation(robot: Robot, parameter: Parameter) -> str:
    kind = robot.ros_type(parameter.type)
    return f"{kind.python} | Sequence[float]" if kind in VECTORS else kind.python


def _data(robot: Robot, data: Data) -> str:
    kind = PRIMITIVES[data.type] if data.type in PRIMITIVES else robot.message(data).python
    return f'self.{data.name}: DataView[{kind}] = DataView(client, "{data.name}")'


def _members(skillset: Skillset) -> Iterator[str]:
    skills, resources = attribute_names(skillset)
    for name, attribute in skills.items():
        yield f'self.{attribute} = {camel(name)}Skill(client, "{name}")'
    for resource in skillset.resources:
        yield _resource(resource, resources[resource.name])


def _resource(resource: Resource, attribute: str) -> str:
    return f'self.{attribute}: ResourceView[{camel(resource.name)}State] = ResourceView(client, "{resource.name}")'


def _states(resource: Resource) -> str:
    return _literal(f"{camel(resource.name)}State", resource.states)


def _literal(name: str, values: Iterable[str]) -> str:
    return wrapped(f"{name} = Literal", [f'"{value}"' for value in values], "", indent=0, brackets="[]")


def _results(skill: Skill) -> str:
    rows = [f"{result.name}{_said(result.comment)}" for result in skill.results]
    return "\n" + lines(["Results:"], 8) + "\n" + lines(rows, 12)


def _said(text: str) -> str:
    said = comment(text).removeprefix("  # ")
    return f", {said}" if said else ""
