"""The main function of a skillset's process."""

from __future__ import annotations

import signal
import sys
import threading
import traceback
from collections.abc import Sequence
from types import FrameType, ModuleType

import rclpy
from rclpy.executors import ExternalShutdownException, ShutdownException, SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions

from skill_language.model import Skillset
from skill_runtime.ros2.data_manager import DataBindings
from skill_runtime.ros2.manager_node import HooksFactory, SkillsetNode

END_S = 2.0


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
    try:
        node = SkillsetNode(skillset, interfaces, hooks_factory, data_bindings=data_bindings)
        spin_until(node, stop)
        node.destroy_node()
    finally:
        rclpy.try_shutdown()


def spin_until(node: SkillsetNode, stop: threading.Event) -> None:
    """Spin a node in a thread of its own until ``stop``; then end its executions while it still spins.

    A callback that raises (most are of hooks) fails what runs, for nobody knows whose function is without its watch now;
    the managers live on.
    """
    # rclpy 7.1.6's EventsExecutor should be lighter, but idles at 60 % of a core with action servers and loses timers.
    executor = SingleThreadedExecutor()
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
                node.engine.fail_all(f"a callback raised {last_line}")
        stop.set()

    def end() -> None:
        over.set()
        executor.shutdown(timeout_sec=0)

    thread = threading.Thread(target=spin, name="executor")
    thread.start()
    stop.wait()
    node.close("the managers were shut down")
    # In the executor's own queue, so after the results of what was failed.
    executor.create_task(end)
    thread.join(END_S)
