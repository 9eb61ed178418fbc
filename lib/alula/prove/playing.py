"""What the plays of a skillset's and of a mission's counterexamples share: functions, models without parameters, and differences."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace

from alula.model.model import Skillset
from alula.runtime.core.execution import Execution
from alula.runtime.core.records import ResourceStatus
from alula.runtime.hooks import SkillHooks


class PlayedFunction(SkillHooks):
    """A function that goes on until the counterexample ends it: what runs of it stands in ``running``, by its id."""

    def __init__(self, running: dict[str, Execution]) -> None:
        self.running = running

    def on_dispatch(self, execution: Execution) -> None:
        """Store the execution as running."""
        self.running[execution.id] = execution


def without_parameters(skillset: Skillset) -> Skillset:
    """Return the model without inputs and outputs, which belong to the hooks: counterexamples do not have them."""
    return replace(skillset, skills=tuple(replace(skill, inputs=(), outputs=()) for skill in skillset.skills))


def differences(statuses: Mapping[str, ResourceStatus], expected: Iterable[tuple[str, str]], skillset: str = "") -> Iterator[str]:
    """Yield each resource whose state in the managers differs from the counterexample; ``skillset`` stands before its name."""
    for name, state in expected:
        found = statuses[name].state
        if found != state:
            yield f"{f'{skillset}.' if skillset else ''}{name} is {found} in the managers, {state} in the counterexample"
