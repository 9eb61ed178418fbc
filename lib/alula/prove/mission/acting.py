"""Stand in below a mission that is played: functions end, and requests arrive, when the run of the counterexample has it."""

from __future__ import annotations

from collections.abc import Callable

from alula.prove.playing import PlayedFunction
from alula.runtime.core.execution import Execution
from alula.runtime.local.middleware import Bus, VirtualLink, VirtualMiddleware
from alula.runtime.middleware import GoalListener


class Function(PlayedFunction):
    """A function that ends when the run says so, also when it was interrupted; ``validated`` says why inputs are refused.

    ``stays`` has the execution that holds in a pause, and does not go on.
    """

    def __init__(self, running: dict[str, Execution], told: dict[str, float], validated: Callable[[], str], stays: set[str]) -> None:
        super().__init__(running)
        self._told = told
        self._validated = validated
        self._stays = stays

    def validate(self, _: object) -> str:
        """Say why they are refused."""
        return self._validated()

    def progress(self, execution: Execution) -> float:
        """Tell what the run says."""
        return self._told.get(execution.id, execution.progress)

    def on_pause(self, execution: Execution) -> str | None:
        """Hold, if it is the one that does."""
        return None if execution.id in self._stays else super().on_pause(execution)

    def on_resume(self, execution: Execution) -> str | None:
        """Refuse."""
        return f"{execution.skill} does not go on, as in the counterexample"

    def on_interrupt(self, execution: Execution) -> bool | None:
        """Wait until the run ends it."""
        return execution.done


class HeldLink(VirtualLink):
    """Keeps goals under way until the run has them arrive."""

    held: dict[str, Callable[[], None]]

    def send(self, goal_id: str, goal: object, on_answer: Callable[[bool], None]) -> None:
        """Keep it."""
        self.held[goal_id] = lambda: super(HeldLink, self).send(goal_id, goal, on_answer)


class HeldMiddleware(VirtualMiddleware):
    """The middleware of a client whose goals are kept in ``held``, by their ids."""

    def __init__(self, bus: Bus, skillset: str, held: dict[str, Callable[[], None]]) -> None:
        super().__init__(bus, skillset)
        self._held = held

    def action(self, skill: str, listener: GoalListener) -> VirtualLink:
        """Return a link that keeps goals."""
        link = HeldLink(self, skill, listener)
        link.held = self._held
        return link
