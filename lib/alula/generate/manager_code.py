"""The Python modules of a managers' package that depend on the skills: inputs and hooks."""

from __future__ import annotations

from alula.generate.manager_templates import HOOKS, HOOKS_CLASS, INPUTS, INPUTS_CLASS, TERMINATED
from alula.generate.python_code import annotation, keyword_only, message_imports, tidy, wrapped
from alula.generate.text import comment, fill, header, lines
from alula.language.robot import Robot
from alula.model.model import Result, Skill, Skillset
from alula.model.ros_types import camel


def inputs_module(robot: Robot, skillset: Skillset) -> str:
    """Return ``inputs.py``: a frozen dataclass a skill."""
    imports = message_imports(robot, [p for skill in skillset.skills for p in skill.inputs])
    checking = ["from typing import TYPE_CHECKING", "", "if TYPE_CHECKING:", *(f"    {line}" for line in imports)]

    def one(skill: Skill) -> str:
        rows = [f"{p.name}: {annotation(robot, p)}{comment(p.comment)}" for p in skill.inputs]
        fields = "\n" + lines(rows, 4) if rows else ""
        return fill(INPUTS_CLASS, camel=camel(skill.name), skill=skill.name, fields=fields).rstrip("\n")

    return tidy(
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
    imports = message_imports(robot, [p for skill in skillset.skills for p in skill.outputs])
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
    return tidy(text.replace("{\n\n}", "{}").replace(f"from {skillset.name}_managers.inputs import (\n\n)\n", ""))


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
    outputs = [f"{p.name}: {annotation(robot, p)}" for p in skill.outputs]
    parameters = ["self", "execution: Execution", 'message: str = ""', *keyword_only(outputs)]
    pairs = [f'"{p.name}": {p.name}' for p in skill.outputs]
    plain = comment(result.comment).removeprefix("  # ")
    return fill(
        TERMINATED,
        result=result.name,
        definition=wrapped(f"def terminated_{result.name}", parameters, " -> bool:", indent=4),
        outputs=f"{{{', '.join(pairs)}}}",
        comment=f" ({plain})" if plain else "",
    )
