"""A mission's plan from its file.

What a file says of a mission besides its main tree, by names: the tree ``ready`` holds what it needs to start (<Needs>), the tree
``stop_here`` brings the robot to rest after an abort. Entries of the main blackboard: ``degraded`` and ``stopping``, once true, say so.
The model of the main tree tells its parameters (input ports with a number as their default), its inputs (without), and what
the mission's account tells of it (output ports, with the value at the beginning).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from py_trees.behaviour import Behaviour
from py_trees.behaviours import Success

from alula.missions.blackboard import Blackboard
from alula.missions.conditions import Condition, answers
from alula.missions.nodes import Needs
from alula.missions.palette import no_class, palette_of
from alula.missions.part import MissionPart
from alula.missions.pending import PendingInterrupts
from alula.missions.plan import InputError, Inputs, MissionPlan
from alula.missions.skills import Crew, SkillNode
from alula.missions.skillset import Client, Clock
from alula.missions.world import World, asked_data, states_of
from alula.model.model import Skillset
from alula.trees.blackboard import Blackboard as TreeBoard
from alula.trees.errors import FileError, TreeError
from alula.trees.factory import build_tree
from alula.trees.node import Node
from alula.trees.palette import Category, Direction, NodeType, Port, node_type
from alula.trees.reading import TreeFiles
from alula.trees.source import TreeSource, source_of
from alula.trees.structure import verify
from alula.trees.tree import Tree

READY, STOP_HERE = "ready", "stop_here"
DEGRADED, STOPPING = "degraded", "stopping"


def ignore(_tree: Tree) -> None:
    """Take no notice."""


class FiledMission:
    """The tree of a file, and what its end means."""

    def __init__(self, make: Maker) -> None:
        self._make = make
        self._board = make.board
        self.tree = make.tree("")
        self.on_stop: Callable[[Tree], None] = ignore
        """Takes the tree that is ticked from now on instead of the mission's."""
        self.root: Node = self.tree.root
        self._needs = [node for node in make.tree(READY).nodes if isinstance(node, Needs)] if READY in make.files.trees else []

    @property
    def degraded(self) -> bool:
        """Tell whether it was accomplished in another way than the best."""
        return bool(self._board.get(DEGRADED))

    @property
    def stopping(self) -> bool:
        """Tell whether the tree has the robot brought to rest by now."""
        return bool(self._board.get(STOPPING))

    def conditions(self) -> list[Condition]:
        """Return what the mission needs to start, met or not."""
        return answers(self._make.crew.clients) + [Condition(node.name, node.unmet) for node in self._needs]

    def stop_here(self) -> Behaviour:
        """Make a tree that brings the robot to rest where it is; where the file has none, there is nothing to add to the halt."""
        if STOP_HERE not in self._make.files.trees:
            return Success(STOP_HERE)
        tree = self.stop_tree()
        self.on_stop(tree)
        return tree.root

    def stop_tree(self) -> Tree:
        """Make the tree `stop_here`, whole; a viewer that goes on with the mission's takes none of its nodes for another."""
        return self._make.tree(STOP_HERE, after=len(self.tree.nodes))


class Maker:
    """Makes the trees of a mission, over one blackboard."""

    def __init__(
        self,
        files: TreeFiles,
        skillsets: Sequence[Skillset],
        part: MissionPart,
        crew: Crew,
        clock_ns: Clock,
        enums: Mapping[str, float],
    ) -> None:
        self.files = files
        self.crew = crew
        self.board = TreeBoard(clock_ns)
        self._clock_ns = clock_ns
        self._enums = {**enums, **states_of(skillsets)}
        self._resources = frozenset(f"{one.name}.{resource}" for one in skillsets for resource in one.resource_index)
        self._data = frozenset(f"{one.name}.{data}" for one in skillsets for data in one.data_index)
        self._palette = palette_of(files, skillsets, part, crew)
        for skillset, data in asked_data(files, skillsets).items():
            if data:
                crew.clients[skillset].follow(data)

    def tree(self, name: str, after: int = 0) -> Tree:
        """Make one; that of the file where no name is given. Its nodes have the uids behind ``after``."""
        world = World(self.crew.clients, self.crew.memory, self._resources, self._data)
        files, palette, board = self.files, self._palette, self.board
        tree = build_tree(files, palette, self._clock_ns, main=name, enums=self._enums, surroundings=world, blackboard=board, after=after)
        for node in tree.nodes:
            if isinstance(node, SkillNode):
                world.leaves.setdefault(node.wiring.type.name, []).append(node)
        return tree


def plan_of_file(mission: Path | TreeSource, name: str, skillsets: Sequence[Skillset], inputs: Inputs, part: MissionPart) -> MissionPlan:
    """Return the plan of a mission's file; raises InputError."""
    source = source_of(mission)
    try:
        files = source.read()
        palette = palette_of(files, skillsets, part)
        verify(files, palette)
        if (problem := no_class(files, palette)) is not None:
            raise FileError(problem)
    except TreeError as error:
        raise InputError(str(error)) from error
    model = files.models.get(files.main) or node_type(files.main, Category.SUBTREE)
    parameters, own = _parameters(model), _inputs(model, inputs, source.path)
    part.check_inputs(own)
    board: list[TreeBoard] = []

    def make(clients: Mapping[str, Client], clock_ns: Clock, values: Mapping[str, float]) -> tuple[FiledMission, Blackboard]:
        memory = part.memory(clock_ns=clock_ns, pending=PendingInterrupts(clock_ns))
        maker = Maker(files, skillsets, part, Crew(clients, memory), clock_ns, source.enums)
        for port in model.ports.values():
            if port.direction is not Direction.INPUT:
                maker.board.set(port.name, _number(port))
        for key, value in {**parameters, **values, **own}.items():
            maker.board.set(key, value)
        board[:] = [maker.board]
        memory.entries = lambda: _shown(maker.board, {*parameters, *own})
        return FiledMission(maker), memory

    def facts() -> Mapping[str, object]:
        told = [port.name for port in model.ports.values() if port.direction is not Direction.INPUT]
        return {name: board[0].get(name) if board else _number(model.ports[name]) for name in told}

    return MissionPlan(name, tuple(one.name for one in skillsets), make, parameters, own, facts)


def _parameters(model: NodeType) -> dict[str, float]:
    return {port.name: _number(port) for port in model.ports.values() if port.direction is Direction.INPUT and port.default is not None}


def _number(port: Port) -> float:
    try:
        return float(port.default or 0)
    except ValueError:
        place = f"{port.place}: " if port.place else ""
        message = f"{place}the default of the mission's port '{port.name}' is '{port.default}', no number; write the number alone"
        raise InputError(message) from None


def _inputs(model: NodeType, inputs: Inputs, path: Path) -> dict[str, object]:
    needed = [port.name for port in model.ports.values() if port.direction is Direction.INPUT and port.default is None]
    missing = [name for name in needed if name not in inputs]
    if missing:
        raise InputError(f"{path}: the mission needs `{missing[0]}` of its world")
    return {name: inputs[name] for name in needed}


def _shown(board: TreeBoard, given: set[str]) -> Mapping[str, object]:
    return {name: value for name, value in board.values().items() if name not in given}
