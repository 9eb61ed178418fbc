"""From waiting for the robot to the outcome of the mission: what happens around the tree. No ROS."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Protocol

from py_trees.behaviour import Behaviour
from py_trees.behaviours import Failure
from py_trees.common import Status

from alula.common.public import public
from alula.missions.conditions import Condition
from alula.missions.context import MissionContext
from alula.missions.pausing import Pause, PauseRefusedError
from alula.missions.treeview import TreeWatch
from alula.trees.view import NodeView

START_TIMEOUT_S = 90.0
"""An autopilot that was just switched on has a position after 42 s, sometimes later."""


@public()
class Outcome(Enum):
    """How a mission ended, or RUNNING.

    DEGRADED: accomplished in another way than the best. GIVEN_UP: the tree failed. SERVED: there was no mission, only skills to serve.
    """

    RUNNING = "running"
    ACCOMPLISHED = "accomplished"
    DEGRADED = "degraded"
    GIVEN_UP = "given_up"
    ABORTED = "aborted"
    NOT_STARTED = "not_started"
    SERVED = "served"


EXIT_CODES = {
    Outcome.ACCOMPLISHED: 0,
    Outcome.DEGRADED: 0,
    Outcome.GIVEN_UP: 1,
    Outcome.ABORTED: 1,
    Outcome.NOT_STARTED: 2,
    Outcome.SERVED: 0,
}


@dataclass(frozen=True)
class MissionResult:
    """The result of a mission: its outcome, and the reason in words."""

    outcome: Outcome
    reason: str = ""


class Mission(Protocol):
    """A mission's tree, its conditions to start, and the tree that stops the robot."""

    @property
    def root(self) -> Behaviour:
        """The tree; SUCCESS means that the mission was accomplished."""
        ...

    @property
    def degraded(self) -> bool:
        """Return whether it was accomplished in another way than the best."""
        ...

    @property
    def stopping(self) -> bool:
        """Return whether the tree already brings the robot to rest, so that an abort has nothing to add."""
        ...

    def conditions(self) -> list[Condition]:
        """Return what the mission needs to start, met or not."""
        ...

    def stop_here(self) -> Behaviour:
        """Make a tree that brings the robot to rest where it is; ticked after an abort."""
        ...


@dataclass(frozen=True)
class DirectorMemory:
    """The state of a director, without its trees; times as ``MissionContext.now_s``, seconds."""

    phase: str
    end: MissionResult | None
    start_s: float | None
    wait_until_s: float | None
    stops: bool


def halted(root: Behaviour) -> list[str]:
    """Halt all that runs in a tree, also where halts raise; return these errors, in words."""
    broken: list[str] = []
    # The root halts what is below it, in the order of the tree. Where that breaks, the others are halted one by one, from the leaves up.
    for node in (root, *root.iterate()):
        try:
            if node is root or node.status is Status.RUNNING:
                node.stop(Status.INVALID)
        except Exception as error:  # noqa: BLE001 - whatever breaks in a halt, no other skill may go on for that
            broken.append(f"its halt raised {type(error).__name__}: {error}")
    return list(dict.fromkeys(broken))


class Director:
    """Waits until the mission can start, ticks its tree, stops the robot after an abort, and settles the outcome.

    ``step`` is to be called after each event, and at 10 Hz once the mission has begun; less often will do before.
    ``serves``: there is no mission; to be told to end is how the run ends well.
    """

    def __init__(
        self, mission: Mission, context: MissionContext, *, start_timeout_s: float = START_TIMEOUT_S, serves: bool = False
    ) -> None:
        self.end: MissionResult | None = None
        self.start_s: float | None = None
        self._mission = mission
        self.context = context
        self._start_timeout_s = start_timeout_s
        self._serves = serves
        self._wait_until_s: float | None = None
        self._watch = TreeWatch(mission.root)
        self._abort_reason = ""
        self._pause: Pause | None = None
        self._held = ""
        self._stop: Behaviour | None = None
        self._stop_watch: TreeWatch | None = None
        self._phase: Callable[[], None] = self._wait

    @property
    def root(self) -> Behaviour:
        """The mission's tree."""
        return self._mission.root

    @property
    def stop_root(self) -> Behaviour | None:
        """The tree that brings the robot to rest, None before an abort."""
        return self._stop

    @property
    def memory(self) -> DirectorMemory:
        """The state of the director that the next step depends on, besides the trees."""
        return DirectorMemory(self._phase.__name__, self.end, self.start_s, self._wait_until_s, self._stop is not None)

    def recall(self, memory: DirectorMemory) -> None:
        """Restore the state of another moment, which must not lie in a pause."""
        self._phase = getattr(self, memory.phase)
        self.end, self.start_s, self._wait_until_s = memory.end, memory.start_s, memory.wait_until_s
        self._pause = None
        self._stop = self._mission.stop_here() if memory.stops else None

    def step(self) -> None:
        """Take one step of the current phase; returns at once. The mission is over when ``end`` is set."""
        if self.end is not None:
            return
        if self._pause is None:
            self._phase()
        else:
            self._held = self._pause.step(self.context.now_s) or self._held

    def refusal(self, *, paused: bool) -> str:
        """Return why the mission can't be paused, or can't go on, now; empty when it can."""
        if not paused:
            return "" if self._pause is not None else "the mission is not paused"
        if self.end is not None or self._phase == self._settle:
            return "the mission is over already"
        if self.start_s is None:
            return "the mission has not started"
        return "the robot is being stopped already" if self._stops else ""

    def pause(self) -> str:
        """Stop ticking until `resume`, and pause the skills that can pause; return what was requested, in words.

        An abort ends the pause, too.

        Raises:
            PauseRefusedError: the mission does not run, or the robot is on its way to rest.
        """
        refusal = self.refusal(paused=True)
        if refusal:
            raise PauseRefusedError(refusal)
        if self._pause is None:
            self._pause = Pause(self._mission.root, self.context.now_s)
        return self._pause.words()

    def resume(self) -> None:
        """Resume the skills, and tick the tree again; raise PauseRefusedError when it is not paused."""
        if self._pause is None:
            raise PauseRefusedError(self.refusal(paused=False))
        self._pause.end()
        self._pause = None

    def news_of_pause(self) -> str:
        """Return, once, which skills have paused and which go on, in words; empty when that has not changed."""
        held, self._held = self._held, ""
        return held

    def abort(self, reason: str) -> str:
        """Stop what runs and bring the robot to rest where it is; return what happens, in words."""
        if self.end is not None:
            return "the mission is over already"
        if self.start_s is None:
            self.end = MissionResult(Outcome.ABORTED, reason)
            return "the mission does not start"
        if self._stops:
            return "the robot is being stopped already"
        self._leave(reason)
        return "the robot stops where it is"

    def broken(self, reason: str, *, ticked: bool = True) -> None:
        """Abort the mission because a tree raised an error, and tick `stop_here`; where `stop_here` raised, settle.

        A mission that has not started ends as NOT_STARTED. ``ticked`` False: not a node raised the error, but what records or shows the
        mission; a tree `stop_here` that is being ticked goes on then.
        """
        if self.end is not None:
            return
        if self.start_s is None:
            self.end = MissionResult(Outcome.NOT_STARTED, reason)
        elif self._stop is None:
            self._leave(reason)
        elif ticked:
            self._abort_reason = "; then ".join([self._abort_reason, reason, *halted(self._stop)])
            self._phase = self._settle

    def conditions(self) -> list[Condition]:
        """Return the conditions to start, met or not; none once the mission has started, or is over."""
        return self._mission.conditions() if self.start_s is None and self.end is None else []

    def remember(self) -> None:
        """Keep each node's status for later views of the tree; replaces a call of ``view`` after each step."""
        self._watch.remember()
        if self._stop_watch is not None:
            self._stop_watch.remember()

    def view(self) -> NodeView:
        """Return the tree as it is now; after an abort with the tree `stop_here` beside it."""
        tree = self._watch.look()
        if self._stop_watch is None or self._serves:
            return tree
        stop = self._stop_watch.look()
        return NodeView("aborted mission", "sequence", stop.status, self._abort_reason, "", (tree, stop))

    @property
    def _stops(self) -> bool:
        try:
            return self._stop is not None or self._mission.stopping
        except Exception:  # noqa: BLE001 - a mission that can't tell may be stopped once more; one that can't be stopped may not be
            return False

    def _leave(self, reason: str) -> None:
        self._pause = None
        said = [reason, *halted(self._mission.root)]
        try:
            self._stop = self._mission.stop_here()
        except Exception as error:  # noqa: BLE001 - whatever keeps it from being made, the mission has to end
            said.append(f"what stops the robot can't be made: {type(error).__name__}: {error}")
            self._stop = Failure("stop_here")
        self._abort_reason = "; then ".join(said)
        self._stop_watch = TreeWatch(self._stop)
        self._phase = self._halt

    # --- phases ------------------------------------------------------------------------------------------------------

    def _wait(self) -> None:
        unmet, now_s = [one.unmet for one in self._mission.conditions() if one.unmet], self.context.now_s
        if self._wait_until_s is None and now_s > 0.0:  # zero: the mission clock was not heard yet
            self._wait_until_s = now_s + self._start_timeout_s
        if not unmet:
            self.start_s = now_s
            self._phase = self._run
        elif self._wait_until_s is not None and now_s > self._wait_until_s:
            self.end = MissionResult(Outcome.NOT_STARTED, "; ".join(unmet))

    def _run(self) -> None:
        self._mission.root.tick_once()
        if self._mission.root.status is not Status.RUNNING:
            self._phase = self._settle

    def _halt(self) -> None:
        if self._stop is not None:
            self._stop.tick_once()
            if self._stop.status is not Status.RUNNING:
                self._phase = self._settle

    def _settle(self) -> None:
        """Wait until what was interrupted has ended; the registry bounds this."""
        if not self.context.pending.names():
            self.end = self._judge()

    def _judge(self) -> MissionResult:
        if self._stop is not None:
            return MissionResult(Outcome.SERVED if self._serves else Outcome.ABORTED, self._abort_reason)
        if self._mission.root.status is not Status.SUCCESS:
            return MissionResult(Outcome.GIVEN_UP, self.context.reason)
        if self._mission.degraded:
            return MissionResult(Outcome.DEGRADED, self.context.what_went_wrong)
        return MissionResult(Outcome.ACCOMPLISHED)
