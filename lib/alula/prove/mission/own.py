"""Nodes of a robot's own in the search: leaves answer freely; what has children is run as it is, or may do anything with them."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

from alula.missions.part import MissionPart
from alula.prove.mission.oracle import Asked, UndecidedError
from alula.prove.mission.reading import ANOTHER
from alula.prove.mission.robot import Robot, SummaryContext
from alula.prove.mission.runnable import names_in, remembered, why_not
from alula.prove.mission.unknown import any_value, is_unknown
from alula.trees.access import written_entries
from alula.trees.ends import ANY_END
from alula.trees.errors import TickError
from alula.trees.node import Condition, Control, Node, SyncAction, name_in_files, register
from alula.trees.node_type import CHILDREN, Category, NodeType
from alula.trees.ports import Direction, Port
from alula.trees.status import FAILURE, IDLE, RUNNING, SKIPPED, SUCCESS, Answer, Skipped

DECLARED = "the file declares it, and no class is known"
OF_NAV2 = "Nav2 declares it, and no class is known"
ANSWER = "answer"
"""What the search asks of a leaf that may answer anything."""
MOST = 20
"""Whole numbers that a node with children remembers are kept up to here; one that counts further may do anything."""


@dataclass(frozen=True)
class Taken:
    """How the search takes a type of node: by its class, or (``why_not``: the class can't be run) as one that may do anything."""

    name: str
    why_not: str = ""
    children: bool = True


@dataclass(frozen=True)
class OwnNodes:
    """The nodes of a robot's own as the search ticks them.

    ``taken``: how, of those with children or without a class. ``unread`` are types that decide by nothing that is known, ``free`` those
    that may decide by anything.
    """

    part: MissionPart
    taken: tuple[Taken, ...]
    unread: tuple[str, ...]
    free: tuple[str, ...]
    why: str = ""
    """Why those with children may do anything whose code could be run."""

    @property
    def any_run(self) -> bool:
        """Return whether the search runs a class with children."""
        return any(not one.why_not for one in self.taken)

    @property
    def names_of_any_order(self) -> frozenset[str]:
        """The types of node that may do anything with their children."""
        return frozenset(one.name for one in self.taken if one.why_not and one.children)


def own_nodes(robot: Robot, part: MissionPart, declared: Sequence[NodeType], why: str = "", *, known: bool = False) -> OwnNodes:
    """Return the nodes of a robot's own for a search.

    ``declared`` are types that the file declares and nothing makes. ``why``: nodes with children may do anything for this reason, though
    their code could be run. With inputs that are ``known`` leaves do what they do as long as they read what is known.
    """
    nodes: list[tuple[str, type[Node]]] = []
    taken: list[Taken] = []
    leaves: list[str] = []
    for real in part.nodes:
        name = name_in_files(real)
        if has_children(real.category, real.child_count):
            reason = why_not(real) or why
            nodes.append((name, _any_order(robot, real) if reason else _run(real)))
            taken.append(Taken(name, reason))
        else:
            nodes.append((name, _known_leaf(robot, real) if known else _leaf(robot, real)))
            leaves.append(name)
    for one in declared:
        content = {"ports": tuple(one.ports.values()), "category": one.category, "child_count": one.children, "__doc__": one.doc}
        children = has_children(one.category, one.children)
        made: type[Node] = type(one.name, (Control if children else Node,), content)
        nodes.append((one.name, _any_order(robot, made) if children else _leaf(robot, made, answers=_declared_answers(one))))
        taken.append(Taken(one.name, OF_NAV2 if one.assumed else DECLARED, children))
    run = {one.name for one in taken if not one.why_not}
    free = tuple(leaves) if known else ()
    unread = tuple(name for name, _ in nodes if name not in run and name not in free)
    return OwnNodes(
        MissionPart(tuple(register(name)(node) for name, node in nodes), context=SummaryContext), tuple(taken), unread, free, why
    )


def has_children(category: Category, count: tuple[int, int | None] | None) -> bool:
    """Return whether a type of node may have children."""
    return (count or CHILDREN[category])[1] != 0


class Own(Node):
    """A node of a robot's own."""


# --- leaves --------------------------------------------------------------------------------------------------------------


ANSWERED = (SUCCESS.value, FAILURE.value, RUNNING.value, SKIPPED.value)


def _declared_answers(known: NodeType) -> tuple[str, ...]:
    """Return what a leaf without a class may answer: anything, unless it is told whether it runs; such a one is never skipped by itself."""
    if known.runs is None:
        return ANSWERED
    return (SUCCESS.value, FAILURE.value, RUNNING.value) if known.runs else (SUCCESS.value, FAILURE.value)


def _answers(real: type[Node]) -> tuple[str, ...]:
    """Return what a leaf may answer: a SyncAction does not run, a Condition runs and any is skipped only where its code says such."""
    names = names_in(real)
    runs = not issubclass(real, SyncAction) and (not issubclass(real, Condition) or not names.isdisjoint({"RUNNING", "Status"}))
    skips = not names.isdisjoint({"SKIPPED", "Skipped"})
    return (SUCCESS.value, FAILURE.value, *((RUNNING.value,) if runs else ()), *((SKIPPED.value,) if skips else ()))


def _leaf(robot: Robot, real: type[Node], answers: tuple[str, ...] = ()) -> type[Node]:
    """Return a leaf that may answer all that one of its kind may, and writes values of which nothing is known."""
    options = answers or _answers(real)

    def update(self: Node) -> Answer:
        return _free(robot, self, options)

    def halt(self: Node) -> None:
        self.become(IDLE)

    content = {"ports": real.ports, "update": update, "category": real.category, "child_count": real.child_count, "halt": halt}
    content |= {**_told_ends(options), "__doc__": real.__doc__}
    return type(real.__name__, (Own,), content)


def _told_ends(options: Sequence[str]) -> dict[str, object]:
    """Return what the class of a leaf that may answer these tells of its ends."""
    return {"ends": frozenset(_ANSWERS[one] for one in options) - {RUNNING}, "may_end": vars(Node)["may_end"]}


def _known_leaf(robot: Robot, real: type[Node]) -> type[Node]:
    """Return a leaf that does what its class does; where that breaks on a value that is not known, it may answer and write anything."""
    options = _answers(real)

    def get(self: Node, port: str) -> object:
        known = self.entry(port) if self.given(port) else None
        if known is not None and is_unknown(known.value):
            raise UndecidedError(f"{self.place()}: the value of the port '{port}' is not known")
        return real.get(self, port)

    def update(self: Node) -> Answer:
        try:
            return real.update(self)
        except Exception as error:
            if _reads_unknown(self):
                return _free(robot, self, options)
            raise TickError(f"{self.place()}: its code raises {type(error).__name__}: {error}") from error

    content = {"get": get, "update": update, **_told_ends(options), "__doc__": real.__doc__}
    return type(real.__name__, (Own, real), content)


def _reads_unknown(node: Node) -> bool:
    ports = (port.name for port in node.config.type.ports.values() if port.direction is not Direction.OUTPUT)
    entries = (node.entry(port) for port in ports if node.given(port))
    return any(entry is not None and is_unknown(entry.value) for entry in entries)


def _free(robot: Robot, node: Node, options: tuple[str, ...]) -> Answer:
    """Return any answer of a leaf, which has written anything."""
    answer = robot.oracle.choose((ANSWER, node.name), options)
    write(robot, node)
    return _ANSWERS[str(answer)]


def actions(nodes: Iterable[Node]) -> frozenset[str]:
    """Return the names of the robot's own leaves that do something: one of these fails, where a condition is no more than false."""
    return frozenset(one.name for one in nodes if isinstance(one, Own) and one.category is Category.ACTION)


def failing_among(choices: Iterable[Asked], names: Collection[str]) -> str:
    """Return the leaf among these that is assumed to fail in a tick, as its action is unknown; empty: none."""
    failed = (str(one.question[1]) for one in choices if one.question[0] == ANSWER and one.answer == FAILURE.value)
    return next((name for name in failed if name in names), "")


def write(robot: Robot, node: Node) -> None:
    """Write unknown values to all outputs."""
    entries = written_entries(node)
    for port in outputs(node):
        node.put(port.name, any_value(robot.oracle, f"`{entries[port.name]}`", robot.uses.type_of(node, port)))


def outputs(node: Node) -> list[Port]:
    """Return the ports that a node may write, and that are connected to an entry."""
    written = written_entries(node)
    return [port for port in node.config.type.ports.values() if port.name in written]


_ANSWERS: Mapping[str, Answer] = {one.value: one for one in (SUCCESS, FAILURE, RUNNING, SKIPPED)}

# --- nodes with children: anything -----------------------------------------------------------------------------------------

SKIPPED_RUNNING = "is skipped, and goes on"
ENDS = (*(f"answers {name}" for name in (FAILURE.value, SUCCESS.value, RUNNING.value, SKIPPED.value)), SKIPPED_RUNNING)
HALTED = ("is halted",)
DOES, WRITES = "does", "writes"


class AnyOrder(Own, Control):
    """Ticks and halts its children in any order, any number of times, and answers anything: the behaviour of a class that is not known.

    It goes on as long as something comes of it that was not so before in this tick.
    """

    robot: ClassVar[Robot]
    halts_all: ClassVar[bool] = True
    """A halt halts all that runs, as that of all controls; False where its class has one of its own."""

    def update(self) -> Answer:
        """Tick and halt children as the oracle chooses, and return any answer."""
        end = self._do_anything(ENDS)
        if end == SKIPPED_RUNNING:
            self.become(RUNNING)
            return SKIPPED
        answer = _ANSWERS[end.removeprefix("answers ")]
        if isinstance(answer, Skipped):
            self.become(IDLE)
        return answer

    def halt(self) -> None:
        """Halt the children that run; where the class has a halt of its own, do anything with them first, and be idle."""
        if self.halts_all:
            self.reset_children()
        else:
            self._do_anything(HALTED)
        self.become(IDLE)

    def _do_anything(self, ends: tuple[str, ...]) -> str:
        oracle = self.robot.oracle
        begin = len(oracle.asked)
        while not self.robot.come_again(begin):
            # The first is what is done where nothing is said; of the others the last is looked at first: short runs are told.
            chosen = str(oracle.choose((DOES, self.name), (ends[0], *self._things(), *ends[1:])))
            if chosen in ends:
                return chosen
            what, _, index = chosen.partition(" child ")
            if what == WRITES:
                write(self.robot, self)
            elif what == "ticks":
                self.children[int(index) - 1].execute()
            else:
                self.reset_child(int(index) - 1)
        return ends[0]

    def _things(self) -> list[str]:
        begun = [number for number, child in enumerate(self.children, 1) if child.status is not IDLE]
        ticks = [f"ticks child {number}" for number in range(len(self.children), 0, -1)]
        return [*([WRITES] if outputs(self) else []), *(f"resets child {number}" for number in begun), *ticks]


def _any_order(robot: Robot, real: type[Node]) -> type[Node]:
    halts_all = real.halt is Control.halt and real.halt_node is Node.halt_node
    content = {"robot": robot, "halts_all": halts_all, "ports": real.ports, "category": real.category, "child_count": real.child_count}
    return type(real.__name__, (AnyOrder,), {**content, "__doc__": real.__doc__})


# --- nodes with children: by their class -------------------------------------------------------------------------------------


class Run(Own):
    """A node with children that its class ticks in the search; it is given no value that the search does not know."""

    def update(self) -> Answer:
        """Do what the class does; raises UndecidedError where its code breaks, which may be for what stands in a clock's place here."""
        try:
            return super().update()
        except (UndecidedError, TickError):
            raise
        except Exception as error:
            raise UndecidedError(f"{self.place()}: its code raises {type(error).__name__}: {error}") from error

    def get(self, port: str) -> object:
        """Return the value of an input; raises UndecidedError where it is not known."""
        known = self.entry(port)
        if known is not None and (is_unknown(known.value) or known.value == ANOTHER):
            raise UndecidedError(f"{self.place()}: the value of the port '{port}' is not known")
        return super().get(port)


def _run(real: type[Node]) -> type[Node]:
    """Return a class that does what another one does, and tells of itself what that one surely tells."""
    content: dict[str, object] = {"remembers": remembered(real), "remembers_running": (), "__doc__": real.__doc__}
    content["ticking"] = real.known_ticking()
    if not real.is_described():
        content |= {"ends": ANY_END, "may_end": vars(Node)["may_end"]}
    return type(real.__name__, (Run, real), content)
