"""The transition system of a mission: its tree, the managers of its skillsets, and what can fail.

    file = MissionFile.read(Path("missions/mapping.xml"), models, part)    # models: the robot's skillsets, part: its MissionPart
    system = System.of(file)
    state = system.initial()                                               # power-up; the mission waits for what it needs
    for event, after in system.steps(state):                               # every step, also those that only an unlucky robot takes
        ...
    system.running(state, "navigation.goto"), system.resource(state, "navigation.flight_status"), system.outcome(state)

States are values that can be compared and hashed. Ticks and managers are asynchronous: what the tree asks for is under way
(`Execution.phase` "sent") until it arrives in a step of its own, and anything may happen before. Ticks that change nothing are no
steps. A tick has one step for each way in which it can go: ``Event.choices`` says what was chosen (a time is over, an unknown number
is large enough, what a node of the robot's own answers). A mission that is over takes no more ticks; what still runs comes to
its end, and nothing else happens.

``Failures`` says what may fail. Which transitions are failures (``Event.failure``)
follows from the models: those that can break an invariant.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TypeVar

from alula.common.graphs import reachable_from
from alula.missions.director import Director, Outcome
from alula.missions.environment import states_of
from alula.missions.mission_file import READY, STOP_HERE, MissionFile, MissionTrees
from alula.missions.plan import InputError, Inputs
from alula.missions.skill_types import OUTCOME_PORT
from alula.model import semantics
from alula.model.conditions import NO_DATA
from alula.model.execution_state import ExecutionState
from alula.model.model import Skillset
from alula.prove.mission.ahead import RUNS
from alula.prove.mission.managers import ENDED, RUNNING, SENT, End, Failures, ManagersSteps
from alula.prove.mission.measured import Conditions
from alula.prove.mission.memory import FEW, Body, TreeMemory
from alula.prove.mission.oracle import Answer, Oracle, Question, UndecidedError
from alula.prove.mission.own import OwnNodes, own_nodes
from alula.prove.mission.reading import what_is_read
from alula.prove.mission.robot import Client, Robot, SummaryContext, Waits
from alula.prove.mission.state import Event, Execution, Kind, Managers, State
from alula.prove.mission.states import Compared
from alula.prove.mission.ticking import ABORT, TICK, OneStop, Ticker
from alula.prove.mission.ticking import Outcome as Ticked
from alula.prove.mission.unknown import any_value
from alula.prove.mission.uses import Uses
from alula.trees.attributes import type_name
from alula.trees.configuration import configure
from alula.trees.node import Node, Shared, name_in_files, pointer
from alula.trees.reading import TreeFiles

T = TypeVar("T")
TERMINATED, FAILED = ExecutionState.TERMINATED.value, ExecutionState.FAILED.value


class System:
    """All runs of a mission. ``skillsets`` are those that its trees name, in the models' order."""

    def __init__(self, ticker: Ticker, body: Body, skillsets: Sequence[Skillset], failures: Failures, own: OwnNodes) -> None:
        self.skillsets = tuple(skillsets)
        self.own = own
        self.failures = failures
        self.ticker = ticker
        self.trees = body.trees
        self.leaves = tuple(ticker.leaves)
        """The leaves that are skills, by the numbers that executions and events have them by."""
        self.nodes: tuple[Node, ...] = tuple(ticker.nodes)
        self._steps = [ManagersSteps(one, self._skills_of(one), failures, self.told_end) for one in skillsets]
        self.reads = body.read
        """What the trees decide by."""
        self._place = {one.name: number for number, one in enumerate(skillsets)}
        self._managers: list[Managers] = []
        self._numbers: dict[Managers, int] = {}
        self._moves: dict[tuple[int, int], tuple[tuple[Event, int], ...]] = {}
        self._startable: dict[tuple[int, int], frozenset[str]] = {}

    @classmethod
    def of(
        cls,
        file: MissionFile,
        failures: Failures = Failures(),  # noqa: B008 - a value
        few: int = FEW,
        known: Inputs | None = None,
        why_any_order: str = "",
        counted: int = 0,
    ) -> System:
        """Return the system of a mission; attempts and rounds are counted exactly up to ``few``, what scripts count below ``counted``.

        With ``known`` inputs the robot's own leaves do what they do; without, they may answer all that they declare. Its nodes with
        children are run where their code can be, unless a reason is given (``why_any_order``).

        Raises InputError where the file can't be used, UndecidedError where the search can't look at it.
        """
        files, path = file.files, file.source.path
        named = _named(files)
        skillsets = [one for one in file.skillsets if one.name in named]
        oracle = Oracle()
        uses = uses_of(file)
        robot = Robot(oracle, Conditions.of(file.roots, skillsets), Compared.of(file.roots, skillsets), uses)
        inputs = any_inputs(file, oracle, uses) if known is None else known
        own = own_nodes(robot, file.part, file.nowhere_made, why_any_order, known=known is not None)
        plan = file.with_models(skillsets, own.part).plan(path.stem, inputs)
        clients = {one.name: Client(robot, one) for one in skillsets}
        oracle.begin(lambda _: None)
        filed, board = plan.make(clients, robot.clock_ns, plan.parameters)  # type: ignore[arg-type]  # a client as far as missions use it
        if not isinstance(filed, MissionTrees) or not isinstance(board, SummaryContext):
            raise InputError(f"{path}: is no mission in a file")
        stop = filed.stop_tree() if STOP_HERE in files.trees else None
        trees = (filed.tree, *([stop] if stop else []))
        director = Director(OneStop(filed, stop), board)
        unread = [*own.unread, *(f"{one.name}.{skill.name}" for one in skillsets for skill in one.skills)]
        roots = [tree.root.config for tree in trees]
        if READY in files.trees:
            roots.append(configure(files, file.registry, READY, Shared(robot.clock_ns), blackboard=filed.tree.blackboard))
        read = what_is_read(roots, unread, plan.parameters, oracle, own.free, counted)
        body = Body(robot, director, board, trees, {one.name: one for one in skillsets}, read, few)
        ticker = Ticker(body, oracle)
        board.pending = Waits(robot, [one.name for one in skillsets], ticker.leaves)
        for number, node in enumerate(ticker.leaves):
            node.leaf.with_inputs(_Starting(robot, number))
        return cls(ticker, body, skillsets, failures, own)

    def looking_at(self, failures: Failures) -> System:
        """Return the same mission with other failures: what is known of its ticks, and the numbers, hold for both."""
        other = copy.copy(self)
        other.failures = failures
        other._steps = [  # noqa: SLF001 - the same class
            ManagersSteps(one, self._skills_of(one), failures, self.told_end) for one in self.skillsets
        ]
        other._moves, other._startable = {}, {}  # noqa: SLF001 - the same class
        return other

    # --- steps -------------------------------------------------------------------------------------------------------

    def initial(self) -> State:
        """Return the situation at power-up."""
        return State(self.ticker.initial, tuple(self.number(one.initial()) for one in self._steps))

    def steps(self, state: State) -> Iterator[tuple[Event, State]]:
        """Yield each step out of a state."""
        if self.outcome(state) is None:
            yield from self._ticks(state, TICK, Kind.TICK)
            if self.failures.aborts and self.may_abort(state.memory):
                yield from self._ticks(state, ABORT, Kind.ABORT)
        for place, number in enumerate(state.managers):
            for event, after in self.moves_of(place, number):
                if self.leaves_out(event, state.memory):
                    continue
                yield event, State(state.memory, (*state.managers[:place], after, *state.managers[place + 1 :]))

    def _ticks(self, state: State, act: str, kind: Kind) -> Iterator[tuple[Event, State]]:
        for ticked in self.ticker.outcomes(state.memory, lambda question: self._observed(state, question), act):
            after = State(ticked.memory, self._commanded(state, ticked))
            if after != state:
                started, interrupted, choices, touched = ticked[1:]
                yield Event(kind, started=started, interrupted=interrupted, choices=choices, touched=touched), after

    def stays(self, state: State) -> Event | None:
        """Return a tick after which all is as before, None where each changes something."""
        for ticked in self.ticker.outcomes(state.memory, lambda question: self._observed(state, question)):
            if State(ticked.memory, self._commanded(state, ticked)) == state:
                return Event(Kind.TICK, started=ticked.started, choices=ticked.choices, touched=ticked.touched)
        return None

    def may_abort(self, number: int) -> bool:
        """Return whether a mission with this memory can be aborted; one that has not begun just ends."""
        memory = self.ticker.memories[number]
        return memory.started and not memory.stops and memory.end is None

    def leaves_out(self, event: Event, memory: int) -> bool:
        """Return whether managers can't take an event with this memory: when the mission is over, only running executions go on."""
        if event.kind is Kind.PAUSE:
            return not self.ticker.may_pause(memory)
        return event.leaf < 0 and self.ticker.memories[memory].end is not None

    def bars(self, memory: int) -> tuple[bool, bool]:
        """Return what the answers of ``leaves_out`` depend on."""
        return self.ticker.memories[memory].end is not None, self.failures.pauses and self.ticker.may_pause(memory)

    def moves_of(self, place: int, number: int) -> tuple[tuple[Event, int], ...]:
        """Return the events possible in one skillset's managers, by its place in ``skillsets``, independent of all other skillsets."""
        key = (place, number)
        if key not in self._moves:
            found = self._steps[place].moves(self._managers[number])
            self._moves[key] = tuple((event, self.number(after)) for event, after in found if after != self._managers[number])
        return self._moves[key]

    def startable(self, place: int, number: int) -> frozenset[str]:
        """Return the skills of a skillset that could start some time after these managers, if nothing ran any more and none died."""
        at = self.number(Managers(self._managers[number].states))
        if (place, at) not in self._startable:
            lasting = reachable_from([at], lambda one: (after for event, after in self.moves_of(place, one) if event.kind is not Kind.DIE))
            several = [self.resource_states(place, one) for one in lasting]
            skills = self.skillsets[place].skills
            found = (skill.name for skill in skills if any(semantics.is_ready(skill, states, NO_DATA) for states in several))
            self._startable[place, at] = frozenset(found)
        return self._startable[place, at]

    def resource_states(self, place: int, number: int) -> dict[str, str]:
        """Return the states of the resources of a skillset; its managers have not died."""
        names = (one.name for one in self.skillsets[place].resources)
        return dict(zip(names, self._managers[number].states or (), strict=True))

    def commanded(self, place: int, number: int, ticked: Ticked) -> int:
        """Return the managers with the requests of a tick under way, without ends that the tree depends on no more."""
        held = self.ticker.memories[ticked.memory].held
        managers = self._managers[number]
        skills = self._steps[place].skills
        kept = [one for one in managers.executions if one.leaf not in ticked.started and (one.phase != ENDED or one.leaf in held)]
        kept = [one._replace(asked=True) if one.leaf in ticked.interrupted and one.phase != ENDED else one for one in kept]
        kept += [Execution(leaf, SENT, asked=leaf in ticked.interrupted) for leaf in ticked.started if leaf in skills]
        kept = [one._replace(left=one.leaf not in held) for one in kept]
        running = [one for one in kept if one.phase == RUNNING]
        others = sorted(one for one in kept if one.phase != RUNNING)
        return self.number(Managers(managers.states, (*running, *others)))

    def _commanded(self, state: State, ticked: Ticked) -> tuple[int, ...]:
        return tuple(self.commanded(place, number, ticked) for place, number in enumerate(state.managers))

    # --- observers ---------------------------------------------------------------------------------------------------

    def memory(self, state: State) -> TreeMemory:
        """Return the memory of the mission."""
        return self.ticker.memories[state.memory]

    def managers_of(self, number: int) -> Managers:
        """Return managers by their number."""
        return self._managers[number]

    def managers(self, state: State, skillset: str) -> Managers:
        """Return the managers of a skillset."""
        return self._managers[state.managers[self._place[skillset]]]

    def outcome(self, state: State) -> Outcome | None:
        """Return how the mission ended, None while it has not."""
        return self.memory(state).end

    def started(self, state: State) -> bool:
        """Return whether the mission has begun: before that it waits for what it needs."""
        return self.memory(state).started

    def resource(self, state: State, name: str) -> str | None:
        """Return the state of ``skillset.resource``, None while its managers are not there."""
        skillset, _, resource = name.partition(".")
        place = self._place[skillset]
        return self._steps[place].resource(self._managers[state.managers[place]], resource)

    def running(self, state: State, skill: str) -> bool:
        """Return whether an execution of ``skillset.skill`` runs in its managers."""
        skillset, _, name = skill.partition(".")
        skills = self._steps[self._place[skillset]].skills
        return any(one.phase == RUNNING and skills[one.leaf] == name for one in self.managers(state, skillset).executions)

    def open(self, state: State) -> list[tuple[int, Execution]]:
        """Return the executions that are requested or run, each with its leaf."""
        return [(one.leaf, one) for number in state.managers for one in self._managers[number].executions if one.phase != ENDED]

    def active(self, state: State) -> list[Node]:
        """Return the nodes that run, from the root down."""
        memory, found, at = self.memory(state), [], 0
        for node in self.nodes:
            if memory.nodes[at] == RUNS:
                found.append(node)
            at += 1 + len(node.remembers) + len(node.remembers_running)
        return found

    def place_of(self, question: Question) -> int:
        """Return the place in ``skillsets`` of the skillset that an observation is of."""
        leaf = question[1]
        return self._place[self.leaves[leaf].skillset if isinstance(leaf, int) else str(leaf)]

    def answer(self, number: int, question: Question) -> Answer:
        """Answer an observation by the managers with this number."""
        managers = self._managers[number]
        match question:
            case ("resource", str(skillset), str(name)):
                return self._steps[self._place[skillset]].resource(managers, name)
            case ("state", str(skillset), str(name), str(state)):
                return self._steps[self._place[skillset]].resource(managers, name) == state
            case ("alive", _):
                return managers.states is not None
            case ("interrupted", _, bool(holds_all)):
                return any(one.asked and not (holds_all and not self.leaves[one.leaf].leaf.halt_waits) for one in managers.executions)
            case ("execution", int(leaf)):
                known = next(one for one in managers.executions if one.leaf == leaf)
                return (known.phase, known.state, known.result) if known.phase == ENDED else (known.phase,)
        raise KeyError(question)

    def _observed(self, state: State, question: Question) -> Answer:
        return self.answer(state.managers[self.place_of(question)], question)

    def told_end(self, leaf: int, end: End) -> End:
        """Return the representative of an end (state and result): the same for all ends between which no node of the tree distinguishes."""
        node = self.leaves[leaf]
        state, result = end
        success = state == TERMINATED and result in node.leaf.success
        outcome = pointer(node.config.ports.get(OUTCOME_PORT, ""), OUTCOME_PORT)
        told = (result or state) if outcome is None else self.reads.value(node.blackboard.where(outcome), result or state)
        if success:
            return (state, result) if outcome is not None and told == result else (TERMINATED, min(node.leaf.success))
        return (state, result) if result in self.reads.ends or (outcome is not None and told == (result or state)) else (FAILED, "")

    def _skills_of(self, skillset: Skillset) -> Mapping[int, str]:
        return {number: leaf.model.name for number, leaf in enumerate(self.leaves) if leaf.skillset == skillset.name}

    def number(self, managers: Managers) -> int:
        """Return the number of managers."""
        number = self._numbers.setdefault(managers, len(self._managers))
        if number == len(self._managers):
            self._managers.append(managers)
        return number


class _Starting:
    """Sets the leaf that starts in the robot; nothing that the search looks at depends on inputs."""

    def __init__(self, robot: Robot, leaf: int) -> None:
        self._robot = robot
        self._leaf = leaf

    def __call__(self, _: object) -> Mapping[str, object]:
        self._robot.starting = self._leaf
        return {}


def look_at(read: Callable[[str], System], look: Callable[[System], T]) -> T:
    """Return what ``look`` finds in a mission's system, which ``read`` gives: ``lambda why: System.of(..., why_any_order=why)``.

    Where a class of the robot's own that was run needs what the search does not know, the system is read again, with all such classes
    taken as ones that may do anything. Raises UndecidedError where anything else needs it.
    """
    system = read("")
    try:
        return look(system)
    except UndecidedError as error:
        if not system.own.any_run:
            raise
        return look(read(str(error)))


def uses_of(file: MissionFile) -> Uses:
    """Return how a mission uses what nodes without a class write, and its inputs."""
    declared = [one.name for one in file.nowhere_made]
    skills = (f"{one.name}.{skill.name}" for one in file.skillsets for skill in one.skills)
    numbers = [*file.source.enums, *states_of(file.skillsets), *(port.name for port in file.given if port.default is not None)]
    return Uses.of(file.roots, declared, [*declared, *skills, *map(name_in_files, file.part.nodes)], numbers)


def any_inputs(file: MissionFile, oracle: Oracle, uses: Uses) -> Inputs:
    """Return any values for the inputs of a mission."""
    ports = (port for port in file.given if port.default is None)
    return {port.name: any_value(oracle, f"`{port.name}`", uses.type_of_input(port)) for port in ports}


def _named(files: TreeFiles) -> frozenset[str]:
    """Return what stands before a dot anywhere in the trees: names of skillsets are among it."""
    found: set[str] = set()
    for tree in files.trees.values():
        for element in tree.iterate():
            texts = [type_name(element), *(one.value for one in element.attributes.values())]
            found |= {word.rpartition(" ")[2] for text in texts for word in _words(text)}
    return frozenset(found)


def _words(text: str) -> list[str]:
    plain = "".join(letter if letter.isalnum() or letter in "_." else " " for letter in text)
    return [part.partition(".")[0] for part in plain.split() if "." in part]
