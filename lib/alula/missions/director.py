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
from alula.missions.blackboard import Blackboard
from alula.missions.conditions import Condition
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
class End:
    """How a mission ended: its outcome, and the reason in words."""

    outcome: Outcome
    reason: str = ""


class Mission(Protocol):
    """A tree, and what its end means."""

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
        """Return whether the tree has the robot brought to rest by now, so that an abort has nothing to add."""
        ...

    def conditions(self) -> list[Condition]:
        """Return what the mission needs to start, met or not."""
        ...

    def stop_here(self) -> Behaviour:
        """Make a tree that brings the robot to rest where it is; ticked after an abort."""
        ...


@dataclass(frozen=True)
class DirectorMemory:
    """Where a director is; times as ``Blackboard.now_s``."""

    phase: str
    end: End | None
    start_s: float | None
    wait_until_s: float | None
    stops: bool


def halted(root: Behaviour) -> list[str]:
    """Halt all that runs in a tree, whatever breaks on the way; return what did, in words."""
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
    """Waits for the robot, has the tree ticked, and knows the outcome.

    ``step`` is to be called after each event, and at 10 Hz once the mission has begun; less often will do before.
    ``serves``: there is no mission; to be told to end is how the run ends well.
    """

    def __init__(self, mission: Mission, blackboard: Blackboard, *, start_timeout_s: float = START_TIMEOUT_S, serves: bool = False) -> None:
        self.end: End | None = None
        self.start_s: float | None = None
        self._mission = mission
        self.blackboard = blackboard
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
        """What the next step hangs on, besides the trees."""
        return DirectorMemory(self._phase.__name__, self.end, self.start_s, self._wait_until_s, self._stop is not None)

    def recall(self, memory: DirectorMemory) -> None:
        """Go on from another moment; a pause is none that can be gone on from."""
        self._phase = getattr(self, memory.phase)
        self.end, self.start_s, self._wait_until_s = memory.end, memory.start_s, memory.wait_until_s
        self._pause = None
        self._stop = self._mission.stop_here() if memory.stops else None

    def step(self) -> None:
        """Do what is to be done now; returns at once. The mission is over when ``end`` is set."""
        if self.end is not None:
            return
        if self._pause is None:
            self._phase()
        else:
            self._held = self._pause.step(self.blackboard.now_s) or self._held

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
        """Tick the tree no more until `resume`, and have the skills that can hold hold; return what was asked for, in words.

        An abort ends the pause, too.

        Raises:
            PauseRefusedError: the mission does not run, or the robot is on its way to rest.
        """
        refusal = self.refusal(paused=True)
        if refusal:
            raise PauseRefusedError(refusal)
        if self._pause is None:
            self._pause = Pause(self._mission.root, self.blackboard.now_s)
        return self._pause.words()

    def resume(self) -> None:
        """Have the skills go on, and tick the tree again; raise PauseRefusedError when it is not paused."""
        if self._pause is None:
            raise PauseRefusedError(self.refusal(paused=False))
        self._pause.end()
        self._pause = None

    def news_of_pause(self) -> str:
        """Return what holds and what goes on since the mission was paused, in words, once; empty when there is nothing new."""
        held, self._held = self._held, ""
        return held

    def abort(self, reason: str) -> str:
        """Stop what runs and bring the robot to rest where it is; return what happens, in words."""
        if self.end is not None:
            return "the mission is over already"
        if self.start_s is None:
            self.end = End(Outcome.ABORTED, reason)
            return "the mission does not start"
        if self._stops:
            return "the robot is being stopped already"
        self._leave(reason)
        return "the robot stops where it is"

    def broken(self, reason: str, *, ticked: bool = True) -> None:
        """Leave a tree that has raised an error: the mission's, also on its way to rest, for what stops the robot; that one for good.

        A mission that has not started moves nothing: it could not start. ``ticked`` False: no node has raised, but what records or
        shows the mission; what stops the robot goes on then.
        """
        if self.end is not None:
            return
        if self.start_s is None:
            self.end = End(Outcome.NOT_STARTED, reason)
        elif self._stop is None:
            self._leave(reason)
        elif ticked:
            self._abort_reason = "; then ".join([self._abort_reason, reason, *halted(self._stop)])
            self._phase = self._settle

    def conditions(self) -> list[Condition]:
        """Return what the mission needs to start; nothing once it has started, or is over."""
        return self._mission.conditions() if self.start_s is None and self.end is None else []

    def remember(self) -> None:
        """Take note of how each node is; for views of the tree at a later time only, instead of ``view`` after each step."""
        self._watch.remember()
        if self._stop_watch is not None:
            self._stop_watch.remember()

    def view(self) -> NodeView:
        """Return the tree as it is now; after an abort with what stops the robot beside it."""
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
        unmet, now_s = [one.unmet for one in self._mission.conditions() if one.unmet], self.blackboard.now_s
        if self._wait_until_s is None and now_s > 0.0:  # zero: the mission clock was not heard yet
            self._wait_until_s = now_s + self._start_timeout_s
        if not unmet:
            self.start_s = now_s
            self._phase = self._run
        elif self._wait_until_s is not None and now_s > self._wait_until_s:
            self.end = End(Outcome.NOT_STARTED, "; ".join(unmet))

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
        if not self.blackboard.pending.names():
            self.end = self._judge()

    def _judge(self) -> End:
        if self._stop is not None:
            return End(Outcome.SERVED if self._serves else Outcome.ABORTED, self._abort_reason)
        if self._mission.root.status is not Status.SUCCESS:
            return End(Outcome.GIVEN_UP, self.blackboard.reason)
        if self._mission.degraded:
            return End(Outcome.DEGRADED, self.blackboard.what_went_wrong)
        return End(Outcome.ACCOMPLISHED)
