"""Mocked skillsets as real ROS 2 nodes: ``python -m skillset_ros2.mock [FOLDER] [--behaviour FILE] ... [--ros-args ...]``.

The interface is that of the real ones, so missions, clients and tools can't tell; the time is the system's, or ``/clock`` with
``-p use_sim_time:=true``. Ends with 0 after SIGINT or SIGTERM, with 2 when it was asked for something that can't be.
"""

from __future__ import annotations

import argparse
import importlib
import signal
import sys
import threading
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import ModuleType

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args

from alula.cli.options.live import mock, mocks
from alula.cli.parser import Parser
from alula.common.fast_dds import leave
from alula.common.faults import FaultError, FaultRequest, parse_fault
from alula.common.robots import BEHAVIOUR, RobotError, find_robot
from alula.common.ros_arguments import without_roslaunch
from alula.common.signals import StopEvent
from alula.language.errors import LanguageError
from alula.language.load import load_robot
from alula.language.robot import Robot
from alula.mock import Behaviour, MockRobot, load_behaviour, starter
from alula.model.model import Skillset
from alula.runtime.core.errors import SkillRuntimeError
from alula.runtime.managers import DataBindings
from skillset_ros2.executor import NodeExecutor
from skillset_ros2.mock_host import RosMockHost
from skillset_ros2.node import SkillsetNode
from skillset_ros2.spin import spin_until

CANNOT_START = 2


class MockRequestError(SkillRuntimeError):
    """The command line asks for something that can't be; the message names it and the remedy."""


class Cast:
    """The skillsets of a mock robot, with what they are made of."""

    def __init__(self, bindings: Mapping[Skillset, DataBindings]) -> None:
        self.bindings = {skillset.name: topics for skillset, topics in bindings.items()}
        self.skillsets = tuple(bindings)
        self.interfaces = {skillset.name: _interfaces(skillset) for skillset in bindings}


class MockNodes:
    """The nodes of a mock robot; ``spin`` serves them until it is told to stop. rclpy must be initialised."""

    def __init__(self, cast: Cast, behaviour: Behaviour, *, seed: int = 0, faults: Sequence[FaultRequest] = ()) -> None:
        self.helper = Node("skill_mocks")
        self.host = RosMockHost(self.helper, cast.bindings)
        self.robot = MockRobot(behaviour.of(frozenset(cast.interfaces)), self.host, seed=seed)
        for fault in faults:
            self.robot.fail(fault)
        self.host.watch(list(cast.interfaces), self.robot.on_state)
        for skillset in cast.skillsets:
            for resource in skillset.resources:
                self.robot.on_state(skillset.name, resource.name, resource.initial)
            self.host.nodes[skillset.name] = self._serve(cast, skillset)
        self.host.after(0.0, self.robot.begin)

    def _serve(self, cast: Cast, skillset: Skillset) -> SkillsetNode:
        hooks = self.robot.hooks_of(skillset)
        return SkillsetNode(skillset, cast.interfaces[skillset.name], lambda _: hooks, data_bindings=cast.bindings[skillset.name])

    def spin(self, stop: threading.Event) -> None:
        """Serve until ``stop``, each skillset in a thread of its own; then end what runs and tell its callers."""
        executor = NodeExecutor()
        executor.add_node(self.helper)
        threads = [threading.Thread(target=spin_until, args=(node, stop), name=name) for name, node in self.host.nodes.items()]
        for thread in threads:
            thread.start()
        try:
            while not stop.is_set():
                executor.spin_once(timeout_sec=0.2)
        except ExternalShutdownException:
            stop.set()
        for thread in threads:
            thread.join()
        executor.shutdown(timeout_sec=0)
        for node in self.host.nodes.values():
            node.destroy_node()
        leave(self.helper)


def parse(words: Sequence[str], *, program: str, folder: bool) -> argparse.Namespace:
    """Read the command line without its ROS arguments."""
    parser = Parser(prog=program, description="Serve skillsets by mocks: the same interface, scripted behaviour.")
    (mock if folder else mocks)(parser)
    given: argparse.Namespace = parser.parse_args(words)
    return given


def read_faults(texts: Sequence[str]) -> list[FaultRequest]:
    """Read the faults of the command line; raise MockRequestError."""
    try:
        return [parse_fault(text) for text in texts]
    except FaultError as error:
        raise MockRequestError(f"--fail: {error}") from None


def make_cast(robot: Robot, names: Sequence[str]) -> Cast:
    """Take the skillsets of a robot, or those that are named; raise MockRequestError."""
    known = [skillset.name for skillset in robot.skillsets]
    for name in names:
        if name not in known:
            raise MockRequestError(f"--skillset {name}: {robot.name} has no such skillset; it has {', '.join(known)}")
    wanted = [skillset for skillset in robot.skillsets if not names or skillset.name in names]
    topics = {
        skillset: {data.name: (robot.source(skillset, data).topic, robot.message(data).ros2) for data in skillset.data}
        for skillset in wanted
    }
    return Cast(topics)


def _interfaces(skillset: Skillset) -> ModuleType:
    try:
        return importlib.import_module(f"{skillset.name}_interfaces.action")
    except ModuleNotFoundError as error:
        raise MockRequestError(
            f"{error.name} is not built, and without it no client can call {skillset.name};"
            " run `alula setup` in the folder of the robot that it belongs to"
        ) from None


def run(cast: Cast, behaviours: Sequence[Path], known: Sequence[Skillset], options: argparse.Namespace, words: Sequence[str]) -> int:
    """Serve until a signal comes; raise SkillRuntimeError before anything is served."""
    behaviour = load_behaviour([*behaviours, *options.behaviour], known)
    faults = read_faults(options.fail)
    rclpy.init(args=list(words), signal_handler_options=SignalHandlerOptions.NO)
    stop = StopEvent()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop.set())
    try:
        nodes = MockNodes(cast, behaviour, seed=options.seed, faults=faults)
        sys.stdout.write(f"mocking {', '.join(cast.interfaces)}; Ctrl-C ends it\n")
        sys.stdout.flush()
        nodes.spin(stop)
    finally:
        rclpy.try_shutdown()
    return 0


def main(arguments: Sequence[str] | None = None) -> int:
    """Mock the skillsets of a robot's folder; return the exit code."""
    words = without_roslaunch(sys.argv if arguments is None else arguments)
    options = parse(remove_ros_args(words)[1:], program="alula mock", folder=True)
    try:
        folder = options.robot or find_robot().skillsets
        robot = load_robot(folder)
        if options.starter:
            sys.stdout.write(starter(robot.skillsets))
            return 0
        shipped = folder / BEHAVIOUR
        cast = make_cast(robot, options.skillset)
        return run(cast, [shipped] if shipped.exists() else [], robot.skillsets, options, words)
    except (LanguageError, RobotError, SkillRuntimeError) as error:
        sys.stderr.write(f"alula mock: {error}\n")
        return CANNOT_START


def main_of(skillset: Skillset, bindings: DataBindings, arguments: Sequence[str] | None = None) -> int:
    """Mock one generated skillset (the entry point of ``<skillset>_managers``); return the exit code."""
    words = without_roslaunch(sys.argv if arguments is None else arguments)
    options = parse(remove_ros_args(words)[1:], program=f"{skillset.name}_managers.mock", folder=False)
    if options.starter:
        sys.stdout.write(starter([skillset]))
        return 0
    try:
        return run(Cast({skillset: bindings}), [], [skillset], options, words)
    except SkillRuntimeError as error:
        sys.stderr.write(f"{skillset.name}_managers.mock: {error}\n")
        return CANNOT_START


if __name__ == "__main__":
    sys.exit(main())
