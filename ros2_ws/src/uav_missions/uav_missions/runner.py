"""The mission's process: the node `/mission`, its arguments, and the files that it leaves behind.

usage: mission --scenario mapping --out DIR --route FILE [--ros-args ...]

Ends with 0 (accomplished, also when degraded), 1 (given up or aborted), 2 (could not start).
"""

from __future__ import annotations

import argparse
import json
import signal
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from skillset_interfaces.msg import Event
from std_msgs.msg import Header, String
from std_srvs.srv import Trigger

from skill_missions.director import EXIT_CODES, Director, End, Outcome
from skill_missions.drawing import draw
from skill_missions.files import EventLog, event_record, write_json, write_text
from skill_missions.pending import PendingInterrupts
from skill_missions.skillset import Handle
from skill_runtime.ros2 import SkillsetClient
from uav_missions.blackboard import RouteBlackboard
from uav_missions.mapping import Clients, MappingMission, Settings
from uav_missions.route import Route, RouteError, load_route

SKILLSETS = ("navigation", "perception", "mapping")
TICK_PERIOD_S = 0.1
TURN_S = 0.1  # wall clock; how soon a signal is seen when nothing else happens
LATCHED = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
ALL_EVENTS = QoSProfile(depth=1000, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)


LAST_EVENTS_S = 2.0  # wall clock to wait for the events of what has ended
UNENDED_STATES = ("REQUESTED", "RUNNING")


class WakingClient:
    """A skillset's client that has the tree ticked at once when an execution ends or a resource changes."""

    def __init__(self, node: Node, skillset: str, wake: Callable[[], None]) -> None:
        self.skillset = skillset
        self.client = SkillsetClient(node, skillset)
        self._wake = wake
        self.client.on_change(lambda *_: wake())

    @property
    def ready(self) -> bool:
        """Tell whether it can be called."""
        return bool(self.client.ready)

    @property
    def resources(self) -> Mapping[str, str]:
        """State of every resource; empty until the skillset was heard of."""
        return dict(self.client.resources)

    def start(self, skill: str, **inputs: object) -> Handle:
        """Start an execution."""
        handle = self.client.start(skill, **inputs)
        handle.add_done_callback(lambda *_: self._wake())
        return handle


class MissionNode(Node):  # type: ignore[misc]  # rclpy is not typed
    """`/mission`: ticks the tree at 10 Hz of the mission clock and after every event, and keeps the run's record."""

    def __init__(self, out: Path, scenario: str, route: Route) -> None:
        super().__init__("mission")
        self.due = False
        self._out = out
        self._scenario = scenario
        self._route = route
        self._lift_off_s: float | None = None
        self._view_json = ""
        self._unended: set[str] = set()
        self._events = EventLog(out / "events.jsonl")
        self._skillsets = {name: WakingClient(self, name, self.wake) for name in SKILLSETS}
        self.director = self._make_director()
        self._heartbeat = self.create_publisher(Header, "/mission/heartbeat", 10)
        self._tree = self.create_publisher(String, "/mission/tree", LATCHED)
        for name in SKILLSETS:
            self.create_subscription(Event, f"/{name}/events", self._on_event, ALL_EVENTS)
        self.create_service(Trigger, "/mission/abort", self._on_abort)
        self.create_timer(TICK_PERIOD_S, self.wake)
        write_json(out / "route.json", {"frame": "map", "route": [list(waypoint) for waypoint in route.waypoints]})
        self.write_mission(End(Outcome.RUNNING))

    @property
    def now_s(self) -> float:
        """Mission clock."""
        return int(self.get_clock().now().nanoseconds) / 1e9

    def wake(self) -> None:
        """Have the tree ticked in this turn of the main loop; several events in one turn make one tick."""
        self.due = True

    def tick(self) -> None:
        """Do one step and tell the world."""
        self.due = False
        try:
            self.director.step()
        except Exception as error:  # noqa: BLE001 - whatever breaks in a tree, the vehicle has to come down
            self.get_logger().error(f"the tree raised {type(error).__name__}: {error}")
            self.director.abort(f"the tree raised {type(error).__name__}: {error}")
        stamp = self.get_clock().now().to_msg()
        self._heartbeat.publish(Header(stamp=stamp, frame_id="mission"))
        self._publish_tree()

    def abort(self, reason: str) -> str:
        """Stop what runs and land where the vehicle is."""
        answer = self.director.abort(reason)
        self.get_logger().warning(f"{reason}: {answer}")
        self.wake()
        return answer

    @property
    def unended(self) -> bool:
        """Tell whether executions are open as far as the events have told: a result may be here before its event."""
        return bool(self._unended)

    def finish(self, end: End) -> None:
        """Write what is left to write."""
        self._publish_tree()
        view = self.director.view()
        title = f"Mission {self._scenario}: {end.outcome.value.replace('_', ' ')}"
        write_json(self._out / "tree.json", view.as_dict())
        write_text(self._out / "tree.svg", draw(view, title))
        self._events.close()
        self.write_mission(end)

    def write_mission(self, end: End) -> None:
        """Write ``mission.json``: also at the start, so that a mission that is killed leaves one that says ``running``."""
        over = end.outcome is not Outcome.RUNNING
        content = {
            "scenario": self._scenario,
            "outcome": end.outcome.value,
            "reason": end.reason,
            "start_s": self.director.start_s,
            "lift_off_s": self._lift_off_s,
            "end_s": self.now_s if over else None,
            "waypoints": len(self._route.waypoints),
            "waypoints_reached": self._route.reached,
        }
        write_json(self._out / "mission.json", content)

    def _make_director(self) -> Director:
        clock_ns = lambda: int(self.get_clock().now().nanoseconds)  # noqa: E731
        blackboard = RouteBlackboard(clock_ns=clock_ns, route=self._route, pending=PendingInterrupts(clock_ns))
        clients = Clients(self._skillsets["navigation"], self._skillsets["perception"], self._skillsets["mapping"])
        settings = Settings(**{name: self._parameter(name, value) for name, value in vars(Settings()).items()})
        timeout_s = self._parameter("start_timeout_s", 60.0)
        return Director(MappingMission(clients, blackboard, settings), blackboard, start_timeout_s=timeout_s)

    def _parameter(self, name: str, default: float) -> Any:
        return self.declare_parameter(name, default).value

    def _publish_tree(self) -> None:
        view_json = json.dumps(self.director.view().as_dict())
        if view_json != self._view_json:
            self._view_json = view_json
            self._tree.publish(String(data=view_json))

    def _on_event(self, event: Event) -> None:
        record = event_record(event)
        self._events.add(record)
        if record.get("skill"):
            change = self._unended.add if record["state"] in UNENDED_STATES else self._unended.discard
            change(str(record["id"]))
        if record.get("resource") == "flight_status" and record["from_state"] == "ON_GROUND" and self._lift_off_s is None:
            self._lift_off_s = float(str(record["stamp_s"]))
        self.wake()

    def _on_abort(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.message = self.abort("aborted by the operator")
        response.success = self.director.end is None or self.director.end.outcome is Outcome.ABORTED
        return response


class Standstill:
    """Notices that the mission clock stands still, on the wall clock."""

    def __init__(self, patience_s: float) -> None:
        self._patience_s = patience_s
        self._last = 0.0
        self._since = time.monotonic()

    def lasts(self, now_s: float) -> bool:
        """Tell whether it has stood still for longer than the patience."""
        if now_s != self._last:
            self._last, self._since = now_s, time.monotonic()
        return time.monotonic() - self._since > self._patience_s


def fly(node: MissionNode, signals: Sequence[int]) -> End:
    """Tick until the mission is over; ``signals`` grows when the process is told to end."""
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    standstill = Standstill(patience_s=60.0)
    obeyed = 0
    while node.director.end is None:
        executor.spin_once(timeout_sec=TURN_S)
        if len(signals) > obeyed:
            obeyed = len(signals)
            node.abort(f"told to end by {signal.Signals(signals[-1]).name}")
        if node.due:
            node.tick()
        if standstill.lasts(node.now_s):
            return End(Outcome.NOT_STARTED if node.director.start_s is None else Outcome.GIVEN_UP, "the mission clock stands still")
    patience = time.monotonic() + LAST_EVENTS_S
    while node.unended and time.monotonic() < patience:
        executor.spin_once(timeout_sec=TURN_S)
    return node.director.end


def parse(arguments: Sequence[str]) -> argparse.Namespace:
    """Read the arguments."""
    parser = argparse.ArgumentParser(prog="mission", description="Fly a mission.")
    parser.add_argument("--scenario", choices=["mapping"], default="mapping", help="which mission")
    parser.add_argument("--out", type=Path, required=True, help="the run's folder")
    parser.add_argument("--route", type=Path, required=True, help="YAML or JSON file with the key 'route': a list of [x, y, z]")
    return parser.parse_args(arguments)


def main(arguments: Sequence[str] | None = None) -> int:
    """Fly the mission; return the exit code."""
    words = list(sys.argv if arguments is None else arguments)
    options = parse(rclpy.utilities.remove_ros_args(words)[1:])
    try:
        route = load_route(options.route)
        options.out.mkdir(parents=True, exist_ok=True)
    except (RouteError, OSError) as error:
        sys.stderr.write(f"mission: {error}\n")
        return EXIT_CODES[Outcome.NOT_STARTED]
    signals: list[int] = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda received, _frame: signals.append(received))
    # rclpy's own handlers would end the communication that is needed to land.
    rclpy.init(args=words, signal_handler_options=SignalHandlerOptions.NO)
    node = MissionNode(options.out, options.scenario, route)
    end = fly(node, signals)
    node.finish(end)
    node.get_logger().info(f"{end.outcome.value}{': ' + end.reason if end.reason else ''}")
    node.destroy_node()
    rclpy.try_shutdown()
    return EXIT_CODES[end.outcome]
