"""The main function of a process that serves skillsets."""

from __future__ import annotations

import argparse
import faulthandler
import os
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from types import FrameType, ModuleType

import rclpy
from rclpy.executors import ExternalShutdownException, ShutdownException
from rclpy.logging import get_logger
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from skillset_interfaces.msg import Heartbeat

from alula.common.fast_dds import leave, small_segment
from alula.common.ros_arguments import ROS_ARGUMENTS, without_roslaunch
from alula.common.shared_memory import sweep_shared_memory
from alula.common.signals import StopEvent
from alula.model.model import Skillset
from alula.runtime.core.errors import SkillRuntimeError
from alula.runtime.hook_processes import RemoteHooks, pipe_address
from alula.runtime.managers import DataBindings
from skillset_ros2.executor import NodeExecutor
from skillset_ros2.names import latched, names_outside
from skillset_ros2.node import HooksFactory, HooksNode, SkillsetNode
from skillset_ros2.processes import RESOURCES, end_with, supervise, wait_for

END_S = 2.0
LISTEN_FIRST_S = 0.5
"""How long (wall clock) managers that begin listen for others."""
PROCESSES_S = 0.5
REFUSED = 2
END_LIMIT_S = 30.0
"""Wall clock; hooks may take some seconds to stop their functions."""
ALL = "all"


@dataclass(frozen=True)
class Served:
    """A skillset that a process serves.

    Attributes:
        skillset: the model.
        interfaces: the generated package ``<skillset>_interfaces``, or its module ``action``.
        hooks_factory: makes the hooks, one a skill.
        data_bindings: where each data of the model comes from; None: as generated.
        words: what the command line of a process for a part of it needs besides the options here.
    """

    skillset: Skillset
    interfaces: ModuleType
    hooks_factory: HooksFactory
    data_bindings: DataBindings | None = None
    words: tuple[str, ...] = ()


def run_skillset(
    skillset: Skillset,
    interfaces: ModuleType,
    hooks_factory: HooksFactory,
    *,
    data_bindings: DataBindings | None = None,
    arguments: Sequence[str] | None = None,
    again: Sequence[str] = (),
) -> None:
    """Serve a skillset until SIGINT or SIGTERM; then stop what runs, report that to its callers, and return.

    ``arguments`` (default: the command line) are ``--processes single|separate``, ``--part NAME`` to serve a part only, and those of
    ROS: ``--ros-args -p use_sim_time:=true``. Exits with 2 when they are wrong. ``again``: what else the command line of a part needs.
    """
    run_skillsets([Served(skillset, interfaces, hooks_factory, data_bindings, tuple(again))], arguments)


def run_skillsets(served: Sequence[Served], arguments: Sequence[str] | None = None) -> None:
    """Serve skillsets, at least one, in this process, each on an executor of its own; otherwise as `run_skillset` does.

    Where managers of one of them are there already, none is served.
    """
    options, words = _options([one.skillset for one in served], sys.argv[1:] if arguments is None else arguments)
    stop = StopEvent()

    def on_signal(number: int, frame: FrameType | None) -> None:  # noqa: ARG001
        stop.set()

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, on_signal)
    if options.parent:
        end_with(options.parent)
    if options.processes == "separate" and options.part == ALL:
        parts = {one.skillset.name: [skill.name for skill in one.skillset.skills] for one in served}
        code = supervise(parts, {one.skillset.name: [*one.words, *words] for one in served}, stop)
        if code:
            sys.exit(code)
        return
    # Processes that were killed have left theirs.
    sweep_shared_memory()
    # Our own handlers: rclpy's would shut the context down before the callers were told.
    rclpy.init(args=words, signal_handler_options=SignalHandlerOptions.NO)
    refused = _serve(options.part, served, words, stop)
    rclpy.try_shutdown()
    faulthandler.cancel_dump_traceback_later()
    if refused:
        sys.stderr.write(f"{refused}\n")
        sys.exit(REFUSED)


def _serve(part: str, served: Sequence[Served], words: Sequence[str], stop: threading.Event) -> str:
    """Serve until ``stop``; return why managers refuse to, or ""."""
    refusals: list[str] = []

    def refuse(reason: str) -> None:
        refusals.append(reason)
        stop.set()

    names = [one.skillset.name for one in served]
    with small_segment():
        first = Node(names[0], enable_rosout=False, start_parameter_services=False)
    nodes: list[Node] = [first]
    try:
        address = "" if part == ALL else pipe_address(os.environ.get("ROS_DOMAIN_ID", ""), *names, *words)
        if part in {ALL, RESOURCES}:
            listen_for_rivals(first, names)
        parts = make_parts(part, served, address=address, stop=stop, on_rival=refuse)
        if parts:
            # Only now: the participant in DDS, which goes with the last node, is that of all nodes.
            nodes = list(parts)
            first.destroy_node()
        for node in parts:
            warn_of_names_outside(node)
        spin_all(parts, stop)
    except SkillRuntimeError as error:
        refuse(str(error))
    finally:
        for node in nodes[:-1]:
            node.destroy_node()
        for node in nodes[-1:]:
            leave(node)
    return refusals[0] if refusals else ""


def warn_of_names_outside(node: Node) -> None:
    """Tell which names of a node in a namespace are not in it: its hooks would hear and command another robot, or nobody."""
    if outside := names_outside(node) if node.get_namespace() != "/" else []:
        node.get_logger().warning(f"not in {node.get_namespace()}: {', '.join(outside)}; hooks write names without the slash in front")


def listen_for_rivals(node: Node, skillsets: Sequence[str]) -> None:
    """Listen for heartbeats of other managers of skillsets, before anything is done that might disturb them.

    Raises:
        SkillRuntimeError: There are some.
    """
    heard: list[str] = []
    for name in skillsets:
        node.create_subscription(Heartbeat, f"{name}/alive", lambda _, name=name: heard.append(name), latched(1))
    executor = NodeExecutor()
    executor.add_node(node)
    end_s = time.monotonic() + LISTEN_FIRST_S
    while not heard and (left_s := end_s - time.monotonic()) > 0:
        executor.spin_once(timeout_sec=left_s)
    executor.shutdown(timeout_sec=0)
    if heard:
        raise SkillRuntimeError(f"managers of {heard[0]} are there already; end them first")


def make_parts(
    part: str, served: Sequence[Served], *, address: str, stop: threading.Event, on_rival: Callable[[str], None]
) -> list[SkillsetNode | HooksNode]:
    """Make the nodes of a part of each skillset, all or none; none, too, when ``stop`` came before. Raises SkillRuntimeError."""
    made: list[SkillsetNode | HooksNode] = []
    try:
        for one in served:
            node = make_part(part, one, address=address, stop=stop, on_rival=on_rival)
            if node is None:
                break
            made.append(node)
    except BaseException as error:  # also of a maker of hooks
        for node in made:
            node.close(str(error))
            node.destroy_node()
        raise
    return made


def make_part(
    part: str, served: Served, *, address: str, stop: threading.Event, on_rival: Callable[[str], None]
) -> SkillsetNode | HooksNode | None:
    """Make the node of a part: ``all`` managers, the ``resources``' or the hooks of a skill; None when ``stop`` came before."""
    skillset, interfaces, bindings = served.skillset, served.interfaces, served.data_bindings
    if part == ALL:
        return SkillsetNode(skillset, interfaces, served.hooks_factory, data_bindings=bindings, on_rival=on_rival)
    if part != RESOURCES:
        return HooksNode(skillset, part, served.hooks_factory, address)
    hooks = RemoteHooks(skillset, address, get_logger(skillset.name).error)
    # A client that finds the skillset can call all of it.
    while hooks.wait(PROCESSES_S):
        if stop.is_set():
            return None
    return SkillsetNode(skillset, interfaces, hooks, data_bindings=bindings, on_rival=on_rival)


def _options(skillsets: Sequence[Skillset], arguments: Sequence[str]) -> tuple[argparse.Namespace, list[str]]:
    """Return the options of this command and the words for ROS."""
    words = without_roslaunch(arguments)
    split = words.index(ROS_ARGUMENTS) if ROS_ARGUMENTS in words else len(words)
    names = ", ".join(skillset.name for skillset in skillsets)
    parts = [RESOURCES, *(skill.name for skill in skillsets[0].skills)] if len(skillsets) == 1 else []
    parser = argparse.ArgumentParser(description=f"Serve {names}.", epilog="ROS arguments follow after --ros-args.")
    parser.add_argument(
        "--processes", choices=["single", "separate"], default="single", help="separate: each skill manager in a process of its own"
    )
    parser.add_argument(
        "--part", choices=[ALL, *parts], default=ALL, metavar="PART", help=f"serve {RESOURCES} or a skill of one skillset only"
    )
    parser.add_argument("--parent", type=int, default=0, metavar="PID", help="end when the process with this id, the parent, ends")
    return parser.parse_args(words[:split]), words[split:]


def _limit_the_end() -> None:
    """Have this process say where it hangs, and end all the same, when its end takes too long: a hook, the middleware."""
    faulthandler.dump_traceback_later(END_LIMIT_S, exit=True)


def spin_all(nodes: Sequence[SkillsetNode | HooksNode], stop: threading.Event) -> None:
    """Spin nodes until ``stop``, and end their executions side by side: hooks may take some seconds to stop a function."""
    threads = [threading.Thread(target=spin_until, args=(node, stop), name=node.get_name()) for node in nodes]
    for thread in threads:
        thread.start()
    if threads:
        wait_for(stop)
        _limit_the_end()
    for thread in threads:
        thread.join()


def spin_until(node: SkillsetNode | HooksNode, stop: threading.Event) -> None:
    """Spin a node in a thread of its own until ``stop``; then end its executions while it still spins.

    A callback that raises (most are of hooks) fails what runs, as it is not known whose function is without its watch now;
    the managers live on.
    """
    executor = NodeExecutor()
    executor.add_node(node)
    over = threading.Event()

    def spin() -> None:
        while not over.is_set():
            try:
                executor.spin()
            except (ExternalShutdownException, ShutdownException):
                break
            except Exception as error:  # noqa: BLE001 - told and failed below
                node.get_logger().error("".join(traceback.format_exception(error)))
                last_line = "".join(traceback.format_exception_only(error)).strip().splitlines()[-1]
                node.fail_all(f"a callback raised {last_line}")
        stop.set()

    def end() -> None:
        """Shut down once nothing else is left: rclpy sends results by tasks, which make others."""
        if executor.idle or time.monotonic() > drain_until_s:
            over.set()
            executor.shutdown(timeout_sec=0)
        else:
            executor.create_task(end)

    thread = threading.Thread(target=spin, name="executor")
    thread.start()
    wait_for(stop)
    node.close("the managers were shut down")
    drain_until_s = time.monotonic() + END_S / 2
    executor.create_task(end)
    thread.join(END_S)
