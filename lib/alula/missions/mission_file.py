"""A mission's plan from its file.

What a file says of a mission besides its main tree, by names: the tree ``ready`` holds what it needs to start (<Needs>), the tree
``stop_here`` brings the robot to rest after an abort. Entries of the main blackboard: ``degraded`` and ``stopping``, once true, say so.
The model of the main tree tells its parameters (input ports with a number as their default), its inputs (without), and what
the mission's account tells of it (output ports, with the value at the beginning).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

from py_trees.behaviour import Behaviour
from py_trees.behaviours import Success

from alula.missions.conditions import Condition, answers
from alula.missions.context import MissionContext
from alula.missions.environment import MissionEnvironment, asked_data, states_of
from alula.missions.nodes import Needs
from alula.missions.part import MissionPart
from alula.missions.pending import PendingInterrupts
from alula.missions.plan import InputError, Inputs, MissionPlan
from alula.missions.registry import no_class, registry_of, without_class
from alula.missions.skills import Crew, SkillNode
from alula.missions.skillset import Client, Clock
from alula.model.model import Skillset
from alula.trees.blackboard import Blackboard
from alula.trees.configuration import configure
from alula.trees.errors import Report, TreeError, refuse
from alula.trees.factory import build_tree
from alula.trees.node import Node, NodeConfig, Shared
from alula.trees.node_type import Category, NodeType, node_type
from alula.trees.ports import Direction, Port
from alula.trees.reading import TreeFiles
from alula.trees.registry import NodeRegistry
from alula.trees.source import TreeSource, source_of
from alula.trees.structure import verify
from alula.trees.tree import Tree

READY, STOP_HERE = "ready", "stop_here"
DEGRADED, STOPPING = "degraded", "stopping"


def ignore(_tree: Tree) -> None:
    """Take no notice."""


@dataclass(frozen=True)
class MissionFile:
    """A mission's file, read once, with the models and the nodes of the robot that it is for: run, check and search begin with it.

    Attributes:
        source: where it was read from.
        files: its trees.
        skillsets: the models whose skills and resources its trees may name.
        part: what the robot adds to missions.
    """

    source: TreeSource
    files: TreeFiles
    skillsets: tuple[Skillset, ...]
    part: MissionPart

    @classmethod
    def read(
        cls,
        mission: Path | TreeSource,
        skillsets: Sequence[Skillset],
        part: MissionPart,
        report: Report = refuse,
        *,
        whole: bool = True,
        text: str | bytes | None = None,
    ) -> MissionFile:
        """Read it; raises FileError. ``text`` is what the file will have, and the others as of `read_files`."""
        source = source_of(mission)
        return cls(source, source.read(report, whole=whole, text=text), tuple(skillsets), part)

    def with_models(self, skillsets: Sequence[Skillset], part: MissionPart | None = None) -> MissionFile:
        """Return it for other models, and for another part of the robot."""
        return replace(self, skillsets=tuple(skillsets), part=part or self.part)

    def declaring(self) -> MissionFile:
        """Return it as if its own file declared what its source says of types of node: so it is proved and played."""
        files = replace(self.files, models={**{one.name: one for one in self.source.types}, **self.files.models})
        return replace(self, source=replace(self.source, types=()), files=files)

    @cached_property
    def registry(self) -> NodeRegistry:
        """The types of node that its trees may have."""
        return registry_of(self.files, self.skillsets, self.part, more=self.source.types)

    @cached_property
    def roots(self) -> tuple[NodeConfig, ...]:
        """The tops of its trees as they will stand, on one blackboard: the main one, `stop_here`, and `ready`; raises InputError."""
        self._verify()
        shared, found = Shared(int), list[NodeConfig]()
        board = Blackboard(shared.clock)
        for name in (self.files.main, *(one for one in (STOP_HERE, READY) if one in self.files.trees)):
            after = sum(1 for root in found for _ in root.walk())
            found.append(configure(self.files, self.registry, name, shared, enums=self.source.enums, blackboard=board, after=after))
        return tuple(found)

    @property
    def nowhere_made(self) -> list[NodeType]:
        """The types of node that its trees use and that are only declared, by its files or by Nav2."""
        names = without_class(self.files, self.registry)
        return [known for name in names if (known := self.registry.get(name)) is not None]

    @property
    def model(self) -> NodeType:
        """What it tells of its main tree: its inputs, its parameters, and what its account tells of it, as ports."""
        return self.files.models.get(self.files.main) or node_type(self.files.main, Category.SUBTREE)

    @property
    def given(self) -> list[Port]:
        """Its parameters, which have a default, and its inputs, which have none."""
        return [port for port in self.model.ports.values() if port.direction is Direction.INPUT]

    def plan(self, name: str, inputs: Inputs) -> MissionPlan:
        """Return its plan; raises InputError where the file, or an input, can't be used."""
        self._verify()
        if (problem := no_class(self.files, self.registry)) is not None:
            raise InputError(str(problem))
        parameters = {port.name: _number(port) for port in self.given if port.default is not None}
        own = self._inputs(inputs)
        self.part.check_inputs(own)
        told = [port for port in self.model.ports.values() if port.direction is not Direction.INPUT]
        board: list[Blackboard] = []

        def make(clients: Mapping[str, Client], clock_ns: Clock, values: Mapping[str, float]) -> tuple[MissionTrees, MissionContext]:
            context = self.part.context(clock_ns=clock_ns, pending=PendingInterrupts(clock_ns))
            maker = Maker(self, Crew(clients, context), clock_ns)
            for port in told:
                maker.board.set(port.name, _number(port))
            for key, value in {**parameters, **values, **own}.items():
                maker.board.set(key, value)
            board[:] = [maker.board]
            context.entries = lambda: _shown(maker.board, {*parameters, *own})
            return MissionTrees(maker), context

        def facts() -> Mapping[str, object]:
            return {port.name: board[0].get(port.name) if board else _number(port) for port in told}

        return MissionPlan(name, tuple(one.name for one in self.skillsets), make, parameters, own, facts)

    def _verify(self) -> None:
        try:
            verify(self.files, self.registry)
        except TreeError as error:
            raise InputError(str(error)) from error

    def _inputs(self, inputs: Inputs) -> dict[str, object]:
        needed = [port.name for port in self.given if port.default is None]
        missing = [name for name in needed if name not in inputs]
        if missing:
            raise InputError(f"{self.source.path}: the mission needs `{missing[0]}` of its world")
        return {name: inputs[name] for name in needed}


def plan_of_file(mission: Path | TreeSource, name: str, skillsets: Sequence[Skillset], inputs: Inputs, part: MissionPart) -> MissionPlan:
    """Return the plan of a mission's file; raises InputError."""
    try:
        file = MissionFile.read(mission, skillsets, part)
    except TreeError as error:
        raise InputError(str(error)) from error
    return file.plan(name, inputs)


class MissionTrees:
    """The trees of a mission that runs, and what their ends mean."""

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
        """Return whether it was accomplished in another way than the best."""
        return bool(self._board.get(DEGRADED))

    @property
    def stopping(self) -> bool:
        """Return whether the tree has the robot brought to rest by now."""
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

    def __init__(self, file: MissionFile, crew: Crew, clock_ns: Clock) -> None:
        skillsets = file.skillsets
        self.files = file.files
        self.crew = crew
        self.board = Blackboard(clock_ns)
        self._clock_ns = clock_ns
        self._enums = {**file.source.enums, **states_of(skillsets)}
        self._resources = frozenset(f"{one.name}.{resource}" for one in skillsets for resource in one.resource_index)
        self._data = frozenset(f"{one.name}.{data}" for one in skillsets for data in one.data_index)
        self._registry = registry_of(file.files, skillsets, file.part, crew)
        for skillset, data in asked_data(file.files, skillsets).items():
            if data:
                crew.clients[skillset].follow(data)

    def tree(self, name: str, after: int = 0) -> Tree:
        """Make one; that of the file where no name is given. Its nodes have the uids behind ``after``."""
        environment = MissionEnvironment(self.crew.clients, self.crew.context, self._resources, self._data)
        files, registry, board = self.files, self._registry, self.board
        tree = build_tree(
            files, registry, self._clock_ns, main=name, enums=self._enums, environment=environment, blackboard=board, after=after
        )
        for node in tree.nodes:
            if isinstance(node, SkillNode):
                environment.leaves.setdefault(node.config.type.name, []).append(node)
        return tree


def _number(port: Port) -> float:
    try:
        return float(port.default or 0)
    except ValueError:
        place = f"{port.place}: " if port.place else ""
        message = f"{place}the default of the mission's port '{port.name}' is '{port.default}', no number; write the number alone"
        raise InputError(message) from None


def _shown(board: Blackboard, given: set[str]) -> Mapping[str, object]:
    return {name: value for name, value in board.values().items() if name not in given}
