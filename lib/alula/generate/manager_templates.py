"""Templates of the Python modules of a managers' package."""

INPUTS = '''\
"""What the skills of ``$skillset`` are called with.

$header.
"""

from __future__ import annotations

from dataclasses import dataclass
$imports
$classes
'''

INPUTS_CLASS = '''

@dataclass(frozen=True, kw_only=True)
class ${camel}Inputs:
    """Inputs of the skill ``$skill``."""
$fields'''

HOOKS = '''\
"""What the developer of a skill of ``$skillset`` writes: a class derived from the abstract one, for each skill.

$header.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING

from alula.runtime.hooks import SkillHooks, unwritten

from ${skillset}_managers.inputs import (
$inputs
)

if TYPE_CHECKING:
$imports    from alula import Execution
$classes


ABSTRACT_HOOKS: dict[str, type[SkillHooks]] = {
$table
}
"""The abstract class of each skill, by the skill's name."""
'''

HOOKS_CLASS = '''

class Abstract${camel}Skill(SkillHooks, ABC):
    """Hooks of the skill ``$skill``."""

    skill = "$skill"
    inputs_type = ${camel}Inputs

    @unwritten
    def validate(self, inputs: ${camel}Inputs) -> str:
        """Return "" to accept the inputs, or why they are refused."""
        return ""

    @abstractmethod
    def on_dispatch(self, execution: Execution) -> None:
        """Start the function with ``execution.inputs``, a ${camel}Inputs; return soon."""

    def progress(self, execution: Execution) -> float:
        """Return how far the function is, 0 to 1$period."""
        return super().progress(execution)

    @abstractmethod
    def on_interrupt(self, execution: Execution) -> bool | None:
        """Stop the function; return False when that is only under way, and call ``execution.interrupted()`` when it is done."""
$results'''

TERMINATED = '''
$definition
        """End the execution with the result $result$comment; False when it has ended already."""
        return execution.terminate("$result", message=message, outputs=$outputs)
'''
