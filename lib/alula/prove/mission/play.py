"""Plays a run of the search: the real mission and the real managers, in virtual time, with the ends, faults and moments of the run.

The tree is ticked when the run ticks it, requests arrive when they arrive there, and functions end when and as the run says. Models are
those of the search: without inputs and outputs, and what data say to their conditions is one resource more (``playable``). What data
say to the conditions of the mission it is told before each tick: values that fit the run's answers.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from alula.missions.director import START_TIMEOUT_S, MissionResult, Outcome
from alula.missions.driver import MissionDriver
from alula.missions.mission_file import MissionFile
from alula.missions.part import MissionPart
from alula.missions.pausing import PauseRefusedError
from alula.missions.record import MissionRecord
from alula.missions.skills import SkillNode
from alula.missions.skillset import MissionClient
from alula.model.execution_state import ExecutionState
from alula.prove.mission.acting import Function, HeldMiddleware
from alula.prove.mission.fitting import COMPARE
from alula.prove.mission.fitting import told as values_told
from alula.prove.mission.measured import of_data
from alula.prove.mission.oracle import Answer, Asked, Oracle, Question
from alula.prove.mission.own import own_nodes
from alula.prove.mission.playable import AS_WANTED, breaks, playable, refuses
from alula.prove.mission.robot import Robot, progress_of
from alula.prove.mission.run import MissionRun
from alula.prove.mission.state import Event, Kind
from alula.prove.mission.system import any_inputs, uses_of
from alula.prove.playing import differences
from alula.runtime.client import Client
from alula.runtime.core.execution import Execution
from alula.runtime.handle import SkillHandle
from alula.runtime.local import LocalManagers, LocalWorld

FLIPPED = {"<": ">", "<=": ">=", ">": "<", ">=": "<=", "==": "=="}
STEP_S = 0.01
"""Between two ticks; times that are over in the run pass before the tick that sees it."""
MORE_S = 1e-6
"""A time is over when it has passed; the mission gives up waiting for its begin when more has."""


class LeftError(Exception):
    """The mission departs from the run; the message has the difference."""


@dataclass(frozen=True)
class Played:
    """The result of a play: the mission's end, where it left the run (empty: nowhere), and the outputs in the mission's account."""

    end: MissionResult
    left: str
    simulated_s: float
    facts: Mapping[str, object]


def play(mission: MissionFile, run: MissionRun, out: Path | None = None) -> Played:
    """Play a run of a mission; with ``out`` the mission is recorded there, as one over mocks."""
    player = _Player(mission, run, out)
    left = ""
    try:
        for number, event in enumerate(run.events, 1):
            try:
                player.take(event)
            except LeftError as error:
                raise LeftError(f"at step {number} of {len(run.events)}: {error}") from None
        player.compare_end()
    except LeftError as error:
        left = str(error)
    return player.finish(left)


class _Answers(Oracle):
    """Answers the questions of a tick as the run does; of what the search did not ask, by the first option."""

    def __init__(self) -> None:
        super().__init__()
        self.choices: list[Asked] = []

    def choose(self, question: Question, options: tuple[Answer, ...] = (False, True)) -> Answer:
        for alike in (operator.eq, _alike):
            for number, one in enumerate(self.choices):
                if alike(one.question, question):
                    return self.choices.pop(number).answer
        return options[0]


def _alike(chosen: Question, asked: Question) -> bool:
    """Return whether a choice of the search answers a comparison in which one number, which the search did not know, is known here."""
    match chosen, asked:
        case ("compare", str(left), str(symbol), str(right)), ("compare", str(one), str(other_symbol), str(other)):
            straight = symbol == other_symbol and (left == one or right == other)
            return straight or (FLIPPED.get(symbol) == other_symbol and (left == other or right == one))
    return False


class _Told(MissionClient):
    """A client whose data have the values of the run."""

    said: dict[str, object]
    on_start: Callable[[SkillHandle], None]

    def start(self, skill: str, **inputs: object) -> SkillHandle:
        """Start a skill, and report it at once: a tree may halt in the same tick what it has started, and start it again."""
        handle = super().start(skill, **inputs)
        self.on_start(handle)
        return handle

    def follow(self, data: Collection[str]) -> None:
        """Ignore it: the managers of a play have no data."""

    def value(self, data: str) -> object | None:
        return self.said.get(f"{self.skillset}.{data}")


class _Player:
    def __init__(self, mission: MissionFile, run: MissionRun, out: Path | None) -> None:
        self._run = run
        self._held: dict[str, Callable[[], None]] = {}
        self._running: dict[str, Execution] = {}
        self._told: dict[str, float] = {}
        """The progress that functions report."""
        self._arriving: Event | None = None
        """The step by which a request arrives now."""
        self._stays: set[str] = set()
        """The execution that holds in a pause, and does not go on."""
        self._handles: dict[int, SkillHandle] = {}
        self._oracle = _Answers()
        playables = [playable(one) for one in run.skillsets]
        self._data = {one.skillset.name: one.data for one in playables}
        self._served = {one.skillset.name: one.skillset for one in playables}
        self.world = LocalWorld(self._served.values(), self._functions)
        file = mission.with_models(run.skillsets)
        uses = uses_of(file)
        own = own_nodes(Robot(self._oracle, uses=uses), file.part, file.nowhere_made, run.why_any_order)
        nodes = MissionPart(own.part.nodes, context=file.part.context)
        plan = file.with_models(run.skillsets, nodes).plan(file.source.path.stem, any_inputs(file, self._oracle, uses))
        plan = replace(plan, inputs={})
        self._facts = plan.facts
        clock_ns = lambda: self.world.clock.now_ns  # noqa: E731
        record = None if out is None else MissionRecord(out, plan, clock_ns, plan.parameters)
        bus = self.world.bus
        self._record = record
        self._starting = -1
        """The leaf that starts a skill now."""
        self._begun: list[tuple[int, SkillHandle]] = []
        """What leaves have started in this tick."""
        self._said: dict[str, object] = {}
        """The values of the data, None for one that is not fresh."""

        def client(name: str, wake: Callable[[], None]) -> _Told:
            made = _Told(Client(HeldMiddleware(bus, name, self._held), name), wake, record)
            made.said, made.on_start = self._said, self._note_start
            return made

        self._driver = MissionDriver(plan, client, clock_ns, plan.parameters, record=record)
        self._driver.woken_by_events = False
        self._stops = False
        self._leaves = [node for node in self._driver.director.root.iterate() if isinstance(node, SkillNode)]
        self._tell_starts(0)
        self.world.on_event(lambda _, event: self._driver.event(event))
        self.world.run_for(0.0)

    def _functions(self, managers: LocalManagers) -> dict[str, Function]:
        return {one.name: Function(self._running, self._told, self._validated, self._stays) for one in managers.skillset.skills}

    def _validated(self) -> str:
        """Refuse the inputs of the request that arrives, or interrupt it while they are looked at: then it never runs."""
        event = self._arriving
        if event is not None and event.kind is Kind.INTERRUPT:
            self.world.managers[event.skillset].engine.interrupt(self._handles[event.leaf].id)
        return "as in the counterexample" if event is not None and event.state == ExecutionState.NOT_VALIDATED.value else ""

    def take(self, event: Event) -> None:
        """Make an event happen; raise LeftError where it does not."""
        match event.kind:
            case Kind.TICK:
                self._tick(event, self._driver.tick)
            case Kind.ABORT:
                self._tick(event, lambda: self._driver.abort("aborted, as in the counterexample"))
            case Kind.START | Kind.REFUSE:
                self._arrive(event)
            case Kind.RESULT:
                self._execution(event).terminate(event.result)
            case Kind.INTERRUPT if self._is_held(event):
                self._arrive(event)
            case Kind.INTERRUPT:
                self._execution(event).interrupted()
            case Kind.EXTERN:
                self._take_to(event.skillset, event.name, event.result)
            case Kind.EVENT:
                self._trigger(event)
            case Kind.BREAK:
                self._execution(event)
                self._say_data(event.skillset, breaks(event.name, event.result))
                self._say_data(event.skillset, AS_WANTED)
            case _:
                self._fail(event)
        self.world.run_for(0.0)
        self._compare(event.skillset, {name: target for name, _, target in event.changes})

    def _trigger(self, event: Event) -> None:
        reply = self.world.managers[event.skillset].engine.trigger(event.name)
        if reply.reason:
            raise LeftError(f"the event {event.skill} is refused: {reply.reason}")

    def _take_to(self, skillset: str, resource: str, state: str) -> None:
        reply = self.world.managers[skillset].transition(resource, state)
        if reply.reason:
            raise LeftError(f"{skillset}.{resource} is not taken to {state}: {reply.reason}")
        self.world.run_for(0.0)

    def _say_data(self, skillset: str, state: str) -> None:
        self._take_to(skillset, self._data[skillset], state)

    def _fail(self, event: Event) -> None:
        """Execute an event that no model has: a function raises, or managers die or restart."""
        match event.kind:
            case Kind.FAIL:
                self._execution(event).fail("as in the counterexample")
            case Kind.PAUSE:
                self._pause(event)
            case Kind.DIE:
                self._die(event.skillset)
            case Kind.RESTART:
                self.world.serve(self._served[event.skillset], self._functions)

    def _die(self, skillset: str) -> None:
        """End managers without a word: what is under way to them is lost."""
        self.world.kill(skillset)
        for leaf, handle in self._handles.items():
            if self._leaves[leaf].skillset == skillset:
                self._held.pop(handle.id, None)

    def _pause(self, event: Event) -> None:
        """Pause the mission and have it go on, which an execution does not: it is interrupted."""
        execution = self._execution(event)
        self._stays.add(execution.id)
        try:
            for paused in (True, False):
                self._driver.set_paused(paused=paused)
                self.world.run_for(0.0)
        except PauseRefusedError as error:
            raise LeftError(f"the mission can't be paused: {error}") from None
        execution.interrupted()

    def _tick(self, event: Event, tick: Callable[[], object]) -> None:
        """Tick the tree, or abort the mission, once times and data are as in the step."""
        over = [float(str(one.question[1])) for one in event.choices if one.question[0] == "time" and one.answer]
        over_s = [one if one == START_TIMEOUT_S else one / 1e9 for one in over]  # the director counts seconds, nodes nanoseconds
        self.world.run_for(max([STEP_S, *(one + MORE_S for one in over_s)]))
        for one in event.choices:
            self._progress(one)
        self._tell_data(event)
        self._begun.clear()
        self._oracle.begin(lambda _: None)
        self._oracle.choices = list(event.choices)
        tick()
        self.world.run_for(0.0)
        self._follow_stop()
        started = []
        for leaf, handle in self._begun:
            if handle.id in self._held:  # else nobody could be asked
                started.append(leaf)
                self._handles[leaf] = handle
        if sorted(started) != sorted(event.started):
            raise LeftError(f"the tree asks for {self._names(started)}, and for {self._names(event.started)} in the counterexample")

    def _follow_stop(self) -> None:
        """Know the leaves of the tree that brings the robot to rest, once there is one: they come after the mission's."""
        stop = self._driver.director.stop_root
        if stop is not None and not self._stops:
            self._stops = True
            more = [node for node in stop.iterate() if isinstance(node, SkillNode)]
            self._leaves += more
            self._tell_starts(len(self._leaves) - len(more))

    def _tell_starts(self, first: int) -> None:
        """Make leaves, from one on, record when they start; nothing that is played depends on inputs."""
        for number, node in enumerate(self._leaves[first:], first):
            node.leaf.with_inputs(partial(self._inputs, number))

    def _inputs(self, leaf: int, _board: object) -> Mapping[str, object]:
        self._starting = leaf
        return {}

    def _note_start(self, handle: SkillHandle) -> None:
        self._begun.append((self._starting, handle))

    def _tell_data(self, event: Event) -> None:
        """Set values that fit the answers of the tick about data."""
        values = values_told(of_data(event.choices))
        if values is None:
            raise LeftError("no values of data fit what the counterexample says of them")
        self._said.update(values)
        for name, value in values.items():
            if self._record is not None and value is not None:
                skillset, _, data = name.partition(".")
                self._record.sample(skillset, data, value, None)

    def _progress(self, choice: Asked) -> None:
        """Make a function report progress that a script answers as in the run; the report arrives before the tick."""
        for leaf, handle in self._handles.items():
            node = self._leaves[leaf]
            if choice.question[:2] != ("compare", progress_of(node.skillset, node.model.name)) or handle.id not in self._running:
                continue
            period = node.model.progress
            _, _, symbol, other = choice.question
            compare, limit = COMPARE[str(symbol)], float(str(other))
            fitting = [one for one in (handle.progress, 0.0, limit, 1.0) if 0.0 <= one <= 1.0 and compare(one, limit) == choice.answer]
            if period is not None and fitting and fitting[0] != handle.progress:
                self._told[handle.id] = fitting[0]
                self.world.run_for(period.period_s)

    def _names(self, leaves: Sequence[int]) -> str:
        return ", ".join(f"{self._leaves[one].skillset}.{self._leaves[one].model.name}" for one in leaves) or "nothing"

    def _arrive(self, event: Event) -> None:
        handle = self._handles[event.leaf]
        by_data = event.failure and event.state == ExecutionState.NOT_READY.value
        if by_data:
            self._say_data(event.skillset, refuses(event.name, event.result))
        self._arriving = event
        self._held.pop(handle.id)()
        self.world.run_for(0.0)
        self._arriving = None
        if by_data:
            self._say_data(event.skillset, AS_WANTED)
        found = f"{handle.state.value} {handle.result}".strip()
        refused = handle.state in {ExecutionState.NOT_READY, ExecutionState.NOT_VALIDATED}
        interrupted = handle.state is ExecutionState.INTERRUPTED
        if refused != (event.kind is Kind.REFUSE) or interrupted != (event.kind is Kind.INTERRUPT):
            raise LeftError(f"{event.skill} is {found}, which it is not in the counterexample")

    def _is_held(self, event: Event) -> bool:
        return event.leaf in self._handles and self._handles[event.leaf].id in self._held

    def _execution(self, event: Event) -> Execution:
        handle = self._handles.get(event.leaf)
        execution = None if handle is None else self._running.get(handle.id)
        if execution is None or execution.done:
            raise LeftError(f"{event.skill} does not run")
        return execution

    def _compare(self, skillset: str, expected: Mapping[str, str], when: str = "") -> None:
        statuses = self.world.managers[skillset].engine.resources if expected else {}
        for difference in differences(statuses, expected.items(), skillset):
            raise LeftError(f"{when}{difference}")

    def compare_end(self) -> None:
        """Raise LeftError where the end is not that of the run."""
        found = self._driver.end.outcome.value if self._driver.end else Outcome.RUNNING.value
        if found != self._run.outcome:
            raise LeftError(f"the mission is {found} at the end, and {self._run.outcome} in the counterexample")
        for name, state in self._run.states:
            skillset, _, resource = name.partition(".")
            self._compare(skillset, {resource: state}, "at the end ")

    def finish(self, left: str) -> Played:
        """Close the record, and return the result; ``left`` is where the mission left the run."""
        end = self._driver.end or MissionResult(
            Outcome.ABORTED, f"it left the counterexample {left}" if left else "the counterexample ends here"
        )
        self._driver.finish(end)
        return Played(end, left, self.world.now_s, self._facts())
