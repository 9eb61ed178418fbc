"""Whether the roles that a robot's skills provide and need fit together, over all its skillsets."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from alula.common.suggestions import nearest
from alula.language.errors import Diagnostic, Severity
from alula.model.model import Skill, Skillset


def role_findings(skillset: Skillset, robot: Sequence[Skillset]) -> Iterator[Diagnostic]:
    """Yield what is wrong with the roles of one skillset of a robot; ``robot`` has it and all the others."""
    providing: dict[str, list[Skill]] = {}
    for skill in (skill for one in robot for skill in one.skills):
        for role in skill.provides:
            providing.setdefault(role.name, []).append(skill)
    for skill in skillset.skills:
        for role in skill.provides:
            other = next((one for one in providing[role.name] if bool(one.successes) != bool(skill.successes)), None)
            if other is not None:
                message = f"`{skill.name}` provides `{role.name}` {_when(skill)}, and `{other.name}` {_when(other)}"
                yield Diagnostic(
                    "ALU229", message, role.span, hint="neither can take the other's place: give them roles of different names"
                )
        for role in skill.needs:
            if role.name not in providing:
                message = f"`{skill.name}` needs `{role.name}`, which no skill of the robot provides"
                hint = nearest(role.name, providing)
                yield Diagnostic("ALU307", message, role.span, Severity.WARNING, hint)


def _when(skill: Skill) -> str:
    return "once it has succeeded" if skill.successes else "while it runs"
