"""A mission on ROS 2: the node `/mission`, ticked until the mission is over.

Needs rclpy; everything else in this package does not.
"""

from __future__ import annotations

import json
import math
import signal
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import rclpy
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from std_msgs.msg import Header, String
from std_srvs.srv import SetBool, Trigger

from alula.common.fast_dds import leave, small_segment
from alula.common.shared_memory import sweep_shared_memory
from alula.common.signals import on_end_signal
from alula.missions.director import EXIT_CODES, START_TIMEOUT_S, MissionResult, Outcome
from alula.missions.driver import TICK_PERIOD_S, MissionDriver
from alula.missions.pausing import PauseRefusedError
from alula.missions.plan import InputError, MissionPlan
from alula.missions.record import MissionRecord
from alula.missions.running import run_to_the_end
from alula.missions.skillset import MissionClient
from alula.runtime.core.events import EngineEvent
from alula.trees.groot.address import ServerError
from alula.trees.view import NodeView
from skillset_ros2 import NodeExecutor, SkillsetClient
from skillset_ros2.base import QUIET_PUBLISHER
from skillset_ros2.fleet_clock import FleetClock
from skillset_ros2.mission_clock import NodeClock
from skillset_ros2.simulated_time import SimulatedTime

WAITING_PERIOD_S = 0.5
"""How often a mission that waits for the robot looks, besides after each event. With a simulated clock it is ``TICK_PERIOD_S``: each tick
tells the simulators how far they may go. Once the mission has begun, its ticks are part of what it does."""
LATCHED = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
BEAT_S = 1.0  # wall clock; heartbeats of a fleet's mission are repeated so often while its clock stands still


class MissionNode(Node):  # type: ignore[misc]  # rclpy is not typed
    """`/mission`: ticks the tree at 10 Hz of the mission clock and after every event, and keeps the run's record.

    Before the mission has begun, it looks at 2 Hz and after every event whether it may begin.
    """

    def __init__(self, out: Path, plan: MissionPlan) -> None:
        # Its parameters are what it was started with; their services are entities that each turn of the executor gathers.
        super().__init__("mission", start_parameter_services=False)
        self._simulated_time = SimulatedTime(self)
        self._mission_clock = NodeClock(self)
        self._plan = plan
        values = {name: self._parameter(name, value) for name, value in plan.parameters.items()}
        joins = bool(self.declare_parameter("joins", value=False).value)
        self._record = MissionRecord(out, plan, self._clock_ns, values, joins=joins)
        self._robots: dict[str, list[MissionClient]] = {}  # clients, by the namespace of their robot
        self.driver = MissionDriver(
            plan,
            self._make_client,
            self._clock_ns,
            values,
            record=self._record,
            say=self.get_logger().warning,
            start_timeout_s=self._parameter("start_timeout_s", START_TIMEOUT_S),
            groot=self._groot(),
        )
        self._view: NodeView | None = None
        self._paces = bool(self.declare_parameter("heartbeat", value=True).value)
        self._heartbeats: dict[str, Publisher] = {}
        self._beat_s = -math.inf  # wall clock
        robots = sorted(filter(None, self._robots))
        self._fleet_clock = FleetClock(self, robots) if robots and self.get_parameter("use_sim_time").value else None
        self._tree = self.create_publisher(String, "mission/tree", LATCHED, event_callbacks=QUIET_PUBLISHER)
        self.create_service(Trigger, "mission/abort", self._on_abort)
        self.create_service(SetBool, "mission/pause", self._on_pause)
        self._ticks = self._mission_clock.every(self.period_s, self.driver.wake)

    @property
    def now_s(self) -> float:
        """Mission clock, seconds."""
        return self._clock_ns() / 1e9

    @property
    def period_s(self) -> float:
        """How often the mission is to be ticked, and how soon (wall clock) a signal is seen, when nothing else happens."""
        waits = self.driver.director.start_s is None and self.driver.end is None and not self._mission_clock.simulated
        return WAITING_PERIOD_S if waits else TICK_PERIOD_S

    def _clock_ns(self) -> int:
        return self._mission_clock.now_ns()

    def turn(self) -> None:
        """Do what is due in this turn of the main loop: several events in one turn make one tick."""
        self._meet()
        if self.driver.due or self.driver.abort_asked:
            self.driver.tick()
            self._keep_pace()
            self._beat()
            self.driver.show(self._publish_tree)
        elif self._fleet_clock is not None and time.monotonic() - self._beat_s > BEAT_S:
            self._fleet_clock.look()
            # A robot may have to wait long for another one; it would take a mission that says nothing for one that hangs.
            self._beat()

    def _keep_pace(self) -> None:
        """Set the timer of the ticks to their period, which changes once."""
        period_ns = round(self.period_s * 1e9)
        if self._ticks.timer_period_ns != period_ns:
            self._ticks.timer_period_ns = period_ns
            self._ticks.reset()

    def finish(self, end: MissionResult) -> None:
        """Write what is left to write."""
        self.driver.show(self._publish_tree)
        self.driver.finish(end)
        for problem in self._record.problems:
            self.get_logger().error(problem)

    def destroy_node(self) -> None:
        """Take no more ticks of a simulated clock, and destroy the node."""
        self._simulated_time.close()
        super().destroy_node()

    def _hear(self, skillset: str, event: EngineEvent) -> None:
        """Take an event under the mission's name of its skillset; robots of a fleet have other clocks, so their events are of now."""
        if self._plan.place(skillset)[0]:
            event = replace(event, skillset=skillset, stamp_ns=self._clock_ns())
        self.driver.event(event)

    def _make_client(self, name: str, wake: Callable[[], None]) -> MissionClient:
        space, skillset = self._plan.place(name)
        client = SkillsetClient(self, skillset, namespace=space)
        # The client's events, not the topic's: so the record has them in the order in which the tree comes to know.
        client.on_event(partial(self._hear, name))
        made = MissionClient(client, wake, self._record, name)
        self._robots.setdefault(space, []).append(made)
        return made

    def _meet(self) -> None:
        """Advertise the heartbeats of a robot once all its skillsets can be called: its simulated time begins with them."""
        for robot, clients in self._robots.items():
            if self._paces and robot not in self._heartbeats and all(client.ready for client in clients):
                # Latched: time waits for the first heartbeats, which may be sent before a bridge has connected.
                topic = f"{robot}/mission/heartbeat" if robot else "mission/heartbeat"
                self._heartbeats[robot] = self.create_publisher(Header, topic, LATCHED, event_callbacks=QUIET_PUBLISHER)
                self.driver.wake()  # the first one at once: the clock may stand still until it comes

    def _beat(self) -> None:
        """Tell the simulators how far the mission has come."""
        self._beat_s = time.monotonic()
        for publisher in self._heartbeats.values():
            publisher.publish(Header(stamp=self.get_clock().now().to_msg(), frame_id="mission"))

    def _parameter(self, name: str, default: float) -> Any:
        return self.declare_parameter(name, default).value

    def _groot(self) -> str:
        """Return where viewers find the tree; a port alone is a number to ROS 2."""
        return str(self.declare_parameter("groot", "", ParameterDescriptor(dynamic_typing=True)).value)

    def _publish_tree(self) -> None:
        view = self.driver.director.view()
        if view != self._view:
            self._view = view
            self._tree.publish(String(data=json.dumps(view.as_dict())))

    def _on_abort(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.message = self.driver.abort("aborted by the operator")
        response.success = self.driver.end is None or self.driver.end.outcome in {Outcome.ABORTED, Outcome.SERVED}
        return response

    def _on_pause(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        try:
            response.success, response.message = True, self.driver.set_paused(paused=request.data)
        except PauseRefusedError as error:
            response.success, response.message = False, str(error)
        return response


def tick_to_the_end(node: MissionNode, signals: list[signal.Signals]) -> MissionResult:
    """Tick until the mission is over; ``signals`` grows when the process receives a signal to end."""
    executor = NodeExecutor()
    executor.add_node(node)

    def turn() -> None:
        executor.spin_once(timeout_sec=node.period_s)
        while signals:
            node.driver.ask_abort(f"told to end by {signals.pop(0).name}")
        if node.driver.end is None:
            node.turn()

    return run_to_the_end(node.driver, turn, lambda: node.now_s)


def run_mission(plan: MissionPlan, out: Path, arguments: Sequence[str] | None = None) -> int:
    """Run a mission in this process; return the exit code: 0 accomplished, 1 given up or aborted, 2 could not start.

    ``arguments`` (default: the command line) may hold ``--ros-args``. SIGINT, SIGTERM and SIGHUP bring the robot to rest first.
    """
    words = list(sys.argv if arguments is None else arguments)
    signals: list[signal.Signals] = []
    on_end_signal(signals.append)
    sweep_shared_memory()
    # rclpy's own handlers would end the communication that is needed to stop the robot.
    rclpy.init(args=words, signal_handler_options=SignalHandlerOptions.NO)
    try:
        with small_segment():
            node = MissionNode(out, plan)
    except (InputError, ServerError) as error:
        sys.stderr.write(f"mission: {error}\n")
        rclpy.try_shutdown()
        return EXIT_CODES[Outcome.NOT_STARTED]
    end = tick_to_the_end(node, signals)
    node.finish(end)
    node.get_logger().info(f"{end.outcome.value}{': ' + end.reason if end.reason else ''}")
    leave(node)
    return EXIT_CODES[end.outcome]
