"""The main function of a skillset's process."""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Sequence
from types import FrameType, ModuleType

import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions

from skill_language.model import Skillset
from skill_runtime.ros2.data_manager import DataBindings
from skill_runtime.ros2.manager_node import HooksFactory, SkillsetNode


def ros2_arguments(arguments: Sequence[str]) -> list[str]:
    """Return the command line without the words that roslaunch adds for ROS 1 (``__name:=...``), which rclpy refuses."""
    return [word for word in arguments if not (word.startswith("__") and ":=" in word)]


def run_skillset(
    skillset: Skillset,
    interfaces: ModuleType,
    hooks_factory: HooksFactory,
    *,
    data_bindings: DataBindings | None = None,
    arguments: Sequence[str] | None = None,
) -> None:
    """Serve a skillset until SIGINT or SIGTERM; then stop what runs, tell its callers, and return.

    ``arguments`` (default: the command line) may set parameters: ``--ros-args -p use_sim_time:=true``.
    """
    words = ros2_arguments(sys.argv if arguments is None else arguments)
    # Our own handlers: rclpy's would shut the context down before the callers were told.
    rclpy.init(args=words, signal_handler_options=SignalHandlerOptions.NO)
    stop = threading.Event()

    def on_signal(number: int, frame: FrameType | None) -> None:  # noqa: ARG001
        stop.set()

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, on_signal)
    node = SkillsetNode(skillset, interfaces, hooks_factory, data_bindings=data_bindings)
    try:
        spin_until(node, stop)
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


def spin_until(node: SkillsetNode, stop: threading.Event) -> None:
    """Spin a node in a thread of its own until ``stop``; then end its executions while it still spins.

    rclpy 7.1.6's EventsExecutor would be lighter but turns idle into 60 % of a core with these nodes.
    """
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    failed: list[BaseException] = []

    def spin() -> None:
        try:
            executor.spin()
        except ExternalShutdownException:
            pass
        except BaseException as error:  # noqa: BLE001 - raised again in the main thread
            failed.append(error)
        finally:
            stop.set()

    thread = threading.Thread(target=spin, name="executor")
    thread.start()
    stop.wait()
    node.close("the managers were shut down")
    executor.create_task(lambda: None).add_done_callback(lambda _: executor.shutdown(timeout_sec=0))
    thread.join(timeout=2.0)
    if failed:
        raise failed[0]
