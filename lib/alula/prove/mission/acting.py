"""Stand in below a mission that is played: functions end, and requests arrive, when the run of the counterexample has it."""

from __future__ import annotations

from collections.abc import Callable

from alula.prove.playing import PlayedFunction
from alula.runtime.core.execution import Execution
from alula.runtime.local.middleware import Bus, VirtualLink, VirtualMiddleware
from alula.runtime.middleware import GoalListener


class Function(PlayedFunction):
    """A function that ends when the run of the counterexample ends it, also after an interruption; ``validated`` gives reasons of refusals.

    ``stays`` has the execution that holds in a pause, and does not go on.
    """

    def __init__(self, running: dict[str, Execution], told: dict[str, float], validated: Callable[[], str], stays: set[str]) -> None:
        super().__init__(running)
        self._told = told
        self._validated = validated
        self._stays = stays

    def validate(self, _: object) -> str:
        """Return why the inputs are refused, empty where they are not."""
        return self._validated()

    def progress(self, execution: Execution) -> float:
        """Return the progress in the run of the counterexample."""
        return self._told.get(execution.id, execution.progress)

    def on_pause(self, execution: Execution) -> str | None:
        """Pause, unless the execution stays in its pause in the run of the counterexample."""
        return None if execution.id in self._stays else super().on_pause(execution)

    def on_resume(self, execution: Execution) -> str | None:
        """Refuse to resume."""
        return f"{execution.skill} does not go on, as in the counterexample"

    def on_interrupt(self, execution: Execution) -> bool | None:
        """Return whether the execution has ended: the run ends it."""
        return execution.done


class HeldLink(VirtualLink):
    """Keeps goals under way until the run has them arrive."""

    held: dict[str, Callable[[], None]]

    def send(self, goal_id: str, goal: object, on_answer: Callable[[bool], None]) -> None:
        """Hold a goal back until the run sends it on."""
        self.held[goal_id] = lambda: super(HeldLink, self).send(goal_id, goal, on_answer)


class HeldMiddleware(VirtualMiddleware):
    """The middleware of a client whose goals are kept in ``held``, by their ids."""

    def __init__(self, bus: Bus, skillset: str, held: dict[str, Callable[[], None]]) -> None:
        super().__init__(bus, skillset)
        self._held = held

    def action(self, skill: str, listener: GoalListener) -> VirtualLink:
        """Return a link that holds goals back."""
        link = HeldLink(self, skill, listener)
        link.held = self._held
        return link
