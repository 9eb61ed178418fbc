"""Drive a mission's director and record it; the host only schedules it: rclpy's timers, virtual time, or a recorded clock."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TypeVar

from alula.missions.director import START_TIMEOUT_S, Director, MissionResult
from alula.missions.leaves import skill_leaf
from alula.missions.pausing import PauseRefusedError
from alula.missions.plan import InputError, MissionPlan
from alula.missions.record import MissionRecord
from alula.missions.skillset import Client, Clock
from alula.missions.treeview import path_of
from alula.missions.watched import watched
from alula.runtime.core.events import EngineEvent

TICK_PERIOD_S = 0.1
Job = Callable[[], None]
T = TypeVar("T")
MakeClient = Callable[[str, Job], Client]
"""Makes a skillset's client of its name, and of what has the tree ticked."""


def later(_tick: Job) -> None:
    """Leave a tick that is due to the host, which looks at ``due``."""


def say_nothing(_line: str) -> None:
    """Ignore the line."""


class MissionDriver:
    """A mission that runs: its tree is ticked, what comes from outside is obeyed, all of it is written down.

    Args:
        plan: the mission.
        client: makes the clients.
        clock_ns: the mission clock.
        parameters: of the mission.
        record: what is written to; None: nothing is.
        soon: has a tick done once, after all that happens at this moment; without it the host looks at ``due``.
        say: takes what is worth a line in a log.
        start_timeout_s: how long the mission waits for what it needs.
        groot: ``HOST:PORT`` where viewers find the tree of a mission that is a file; empty: nowhere.

    Raises:
        InputError: the mission can't be made.
        ServerError: the tree can't be shown to viewers.
    """

    def __init__(
        self,
        plan: MissionPlan,
        client: MakeClient,
        clock_ns: Clock,
        parameters: Mapping[str, float],
        *,
        record: MissionRecord | None = None,
        soon: Callable[[Job], object] = later,
        say: Callable[[str], None] = say_nothing,
        start_timeout_s: float = START_TIMEOUT_S,
        groot: str = "",
    ) -> None:
        self.due = False
        self.woken_by_events = True
        """False: only the host schedules ticks of the tree."""
        self.remembers = False
        """Views of the tree are wanted although there is no record."""
        self.record = record
        self._clock_ns = clock_ns
        self._soon = soon
        self._say = say
        self._aborts: list[str] = []
        self._problems: list[str] = []
        clients = {name: client(name, self.wake) for name in plan.skillsets}
        try:
            mission, self.context = plan.make(clients, clock_ns, parameters)
        except InputError:
            raise
        except Exception as error:  # also a robot's own nodes are made here
            raise InputError(f"the mission can't be made: {type(error).__name__}: {error}") from error
        self.leaves = [(leaf, path_of(node)) for node in mission.root.iterate() if (leaf := skill_leaf(node)) is not None]
        self._watched = watched(mission, clock_ns, record, groot)
        self.director = Director(mission, self.context, start_timeout_s=start_timeout_s, serves=plan.serves)

    @property
    def end(self) -> MissionResult | None:
        """How the mission ended; None while it runs."""
        return self.director.end

    # --- when --------------------------------------------------------------------------------------------------------

    def wake(self) -> None:
        """Have the tree ticked once after all that happens at this moment."""
        if self.woken_by_events and not self.due and self.end is None:
            self.due = True
            self._soon(self.tick)

    def tick_regularly(self, after: Callable[[float, Job], object], period_s: float = TICK_PERIOD_S) -> None:
        """Have the tree ticked now and every ``period_s`` to the mission's end; ``after`` has a job done after seconds of mission clock."""
        if self.end is None:
            after(period_s, lambda: self.tick_regularly(after, period_s))
            self.wake()

    def tick(self) -> None:
        """Do one step, and write down what it was."""
        self.due = False
        if self._aborts:
            self.abort(self._aborts.pop())
            self._aborts.clear()
        if self.record is not None:
            self.record.tick(self._guarded(self.director.conditions) or [])
        self._guarded(self.director.step)
        self._note_step()

    def show(self, act: Job) -> None:
        """Do what shows the mission; where it raises, the mission is aborted as by an error of its tree."""
        try:
            act()
        except Exception as error:  # noqa: BLE001 - whatever breaks, the robot has to come to rest
            self._unaccounted(f"the mission can't be shown: {type(error).__name__}: {error}")

    def _guarded(self, act: Callable[[], T]) -> T | None:
        """Do what asks the tree; where it raises, the tree is left."""
        try:
            return act()
        except Exception as error:  # noqa: BLE001 - whatever breaks in a tree, the robot has to come to rest
            reason = f"the tree raised {type(error).__name__}: {error}"
            self._say(reason)
            self.director.broken(reason)
            return None

    def _unaccounted(self, reason: str) -> None:
        """Leave the tree of a mission that can't be recorded or shown; once, as what raises may do so at each tick."""
        if not self._problems:
            self._problems.append(reason)
            self._say(reason)
            self.director.broken(reason, ticked=False)

    def _note_step(self) -> None:
        if self._watched is not None:
            self.show(self._watched.commit)
        held = self.director.news_of_pause()
        if self.record is not None:
            if held:
                self.record.told("paused", held)
            self.record.outcome_of_tick(self.director)
            if self.record.failure:
                self._unaccounted(self.record.failure)
        elif self.remembers:
            self.director.remember()

    # --- what comes from outside -------------------------------------------------------------------------------------

    def event(self, event: EngineEvent) -> None:
        """Take an event of a skillset."""
        if self.record is not None:
            self.record.event(event)
        self.wake()

    def ask_abort(self, reason: str) -> None:
        """Have the robot come to rest at the next tick; may be called by a signal's handler."""
        self._aborts.append(reason)

    @property
    def abort_asked(self) -> bool:
        """Return whether the next tick has the robot come to rest."""
        return bool(self._aborts)

    def abort(self, reason: str) -> str:
        """Stop what runs and bring the robot to rest where it is; return what happens, in words."""
        if self.record is not None:
            self.record.abort(reason)
        answer = self.director.abort(reason)
        self._say(f"{reason}: {answer}")
        if self.end is None:
            self.wake()
        else:  # it had not begun: there is no other tick
            self._note_step()
        return answer

    def set_paused(self, *, paused: bool) -> str:
        """Pause the mission, or have it go on; return what happens, in words. Raises PauseRefusedError."""
        refusal = self.director.refusal(paused=paused)
        if refusal:
            raise PauseRefusedError(refusal)
        if self.record is not None:
            self.record.told("pause" if paused else "resume", "")
        if paused:
            answer = f"the mission is paused: {self.director.pause()}"
        else:
            self.director.resume()
            answer = "the mission goes on"
        self._say(answer)
        self.wake()
        return answer

    # --- the end -----------------------------------------------------------------------------------------------------

    @property
    def settled(self) -> bool:
        """Return whether the events of all that has ended are here; a result may come before its event."""
        return self.record is None or not self.record.unended

    def finish(self, end: MissionResult) -> None:
        """Write what is left to write, and show the tree no more."""
        if self._watched is not None:
            self.show(self._watched.close)
        if self.record is not None:
            self.record.problems += self._problems + ([] if self._watched is None else self._watched.problems)
            self.record.finish(end, self.director, self._clock_ns() / 1e9)
