"""The Python modules of a managers' package that depend on the skills: inputs, hooks, client."""

from __future__ import annotations

from collections.abc import Sequence

from skill_language.generate.manager_templates import CLIENT, CLIENT_METHOD, HOOKS, HOOKS_CLASS, INPUTS, INPUTS_CLASS, TERMINATED
from skill_language.generate.text import comment, fill, header, lines, packages
from skill_language.model import Parameter, Result, Skill, Skillset
from skill_language.robot import Robot
from skill_language.ros_types import camel

WIDTH = 140
"""Longest line of generated code, the formatter's setting of this tree."""


def inputs_module(robot: Robot, skillset: Skillset) -> str:
    """Return ``inputs.py``: a frozen dataclass a skill."""
    imports = _message_imports(robot, [p for skill in skillset.skills for p in skill.inputs])
    checking = ["from typing import TYPE_CHECKING", "", "if TYPE_CHECKING:", *(f"    {line}" for line in imports)]

    def one(skill: Skill) -> str:
        rows = [f"{p.name}: {_annotation(robot, p)}{comment(p.comment)}" for p in skill.inputs]
        fields = "\n" + lines(rows, 4) if rows else ""
        return fill(INPUTS_CLASS, camel=camel(skill.name), skill=skill.name, fields=fields).rstrip("\n")

    return _tidy(
        fill(
            INPUTS,
            skillset=skillset.name,
            header=header(robot, skillset),
            imports=lines(checking) if imports else "",
            classes="\n".join(one(skill) for skill in skillset.skills),
        )
    )


def hooks_module(robot: Robot, skillset: Skillset) -> str:
    """Return ``hooks.py``: an abstract class a skill, with one ``terminated_`` method a result."""
    imports = _message_imports(robot, [p for skill in skillset.skills for p in skill.outputs])
    names = sorted(f"{camel(skill.name)}Inputs" for skill in skillset.skills)
    table = [f'"{skill.name}": Abstract{camel(skill.name)}Skill,' for skill in skillset.skills]
    text = fill(
        HOOKS,
        skillset=skillset.name,
        header=header(robot, skillset),
        inputs=lines((f"{name}," for name in names), 4),
        imports="".join(f"    {line}\n" for line in imports),
        classes="\n".join(_hooks_class(robot, skill).rstrip("\n") for skill in skillset.skills),
        table=lines(table, 4),
    )
    return _tidy(text.replace("{\n\n}", "{}").replace(f"from {skillset.name}_managers.inputs import (\n\n)\n", ""))


def client_module(robot: Robot, skillset: Skillset) -> str:
    """Return ``client.py``: a client with a method a skill."""
    imports = _message_imports(robot, [p for skill in skillset.skills for p in skill.inputs])

    def method(skill: Skill) -> str:
        parameters = [f"{p.name}: {_annotation(robot, p)}" for p in skill.inputs]
        return fill(
            CLIENT_METHOD,
            skill=skill.name,
            definition=_wrapped(f"def {skill.name}", ["self", *_keyword_only(parameters)], " -> SkillHandle:", indent=4),
            start=_wrapped("return self.start", [f'"{skill.name}"', *(f"{p.name}={p.name}" for p in skill.inputs)], "", indent=8),
            results=", ".join(result.name for result in skill.results),
        ).rstrip("\n")

    return _tidy(
        fill(
            CLIENT,
            skillset=skillset.name,
            camel=camel(skillset.name),
            header=header(robot, skillset),
            imports="".join(f"    {line}\n" for line in imports),
            methods="\n".join(method(skill) for skill in skillset.skills),
        )
    )


# --- parts -----------------------------------------------------------------------------------------------------------


def _hooks_class(robot: Robot, skill: Skill) -> str:
    return fill(
        HOOKS_CLASS,
        camel=camel(skill.name),
        skill=skill.name,
        period=f"; asked every {skill.progress.period_s:g} s" if skill.progress else "",
        results="".join(_terminated(robot, skill, result) for result in skill.results),
    )


def _terminated(robot: Robot, skill: Skill, result: Result) -> str:
    outputs = [f"{p.name}: {_annotation(robot, p)}" for p in skill.outputs]
    parameters = ["self", "execution: Execution", 'message: str = ""', *_keyword_only(outputs)]
    pairs = [f'"{p.name}": {p.name}' for p in skill.outputs]
    plain = comment(result.comment).removeprefix("  # ")
    return fill(
        TERMINATED,
        result=result.name,
        definition=_wrapped(f"def terminated_{result.name}", parameters, " -> bool:", indent=4),
        outputs=f"{{{', '.join(pairs)}}}",
        comment=f" ({plain})" if plain else "",
    )


def _wrapped(before: str, items: Sequence[str], after: str, *, indent: int) -> str:
    """Return `before(items)after` on one line, or, as the formatter would, an item a line."""
    margin = " " * indent
    one = f"{margin}{before}({', '.join(items)}){after}"
    if len(one) <= WIDTH:
        return one
    # A bare `*` has no comma-less form of its own: it is an item like any other.
    return f"{margin}{before}(\n" + lines((f"{item}," for item in items), indent + 4) + f"\n{margin}){after}"


def _keyword_only(parameters: Sequence[str]) -> list[str]:
    return ["*", *parameters] if parameters else []


def _annotation(robot: Robot, parameter: Parameter) -> str:
    return robot.ros_type(parameter.type).python


def _message_imports(robot: Robot, parameters: Sequence[Parameter]) -> list[str]:
    return [f"import {package}.msg" for package in packages(robot.ros_type(p.type) for p in parameters)]


def _tidy(text: str) -> str:
    """Return the text with at most two empty lines in a row, and one line end at its end."""
    while "\n\n\n\n" in text:
        text = text.replace("\n\n\n\n", "\n\n\n")
    return text.rstrip("\n") + "\n"
