"""The simulator's node: steps simulated time, in lockstep with the nodes that work on its measurements, and publishes what happens."""

from __future__ import annotations

import json
import queue
import signal
import time
from dataclasses import asdict, replace
from pathlib import Path

import rosgraph
import rospy
from geometry_msgs.msg import PoseStamped
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String
from tf2_msgs.msg import TFMessage
from uav_msgs.srv import SetSensor, SetSensorRequest, SetSensorResponse

from alula.common.faults import FaultError, parse_faults
from alula.common.signals import StopEvent
from resource_reporter import send_directly
from uav_simulator import ros_messages
from uav_simulator.drivers import Drivers
from uav_simulator.errors import ConfigError, SimulatorError
from uav_simulator.imperfections import parse_imperfections
from uav_simulator.pacing import Pacer, header_stamp_s
from uav_simulator.pilots import make_pilot
from uav_simulator.sensors.faults import FAULTS
from uav_simulator.settings import SimulatorSettings, settings_from_params
from uav_simulator.simulation import TICK_S, Simulation
from uav_simulator.world.config import find_world, load_world
from uav_simulator.world.ply import write_mesh

POSE_PERIOD_NS = 50_000_000
STATE_PERIOD_NS = 1_000_000_000
START_CLOCK_S = 0.05  # how often the first tick is told while time has not begun, for nodes that come late
CATCH_UP_S = 0.25  # a delay of more is not made up for
# Behind an autopilot that does not wait: then pictures and sweeps are left out, and nodes are not waited for. Poses and measurements are
# apart by as much, which 0.1 s of a turn at 40 degrees a second makes 4 degrees.
LATE_S = 0.1
LATE_TOLD_S = 10.0  # wall clock


def unconnected() -> list[str]:
    """Return the topics of this node that more nodes have subscribed to, as the master knows, than are connected to it."""
    _, subscribed, _ = rosgraph.Master(rospy.get_name()).getSystemState()
    nodes = {topic: len(names) for topic, names in subscribed}
    published = rospy.topics.get_topic_manager().pubs
    return [topic for topic, publication in published.items() if publication.get_num_connections() < nodes.get(topic, 0)]


class SimulatorNode:
    """Wires the simulation to ROS and to a MAVLink client."""

    def __init__(self, settings: SimulatorSettings) -> None:
        self._settings = settings
        config = load_world(find_world(settings.world))
        self._pilot = make_pilot(settings, config.home)
        self._simulation = Simulation(
            config,
            self._pilot.flown,
            seed=settings.seed,
            faults=parse_faults(settings.faults, FAULTS),
            imperfections=parse_imperfections(settings.imperfections),
        )
        if settings.world_path:
            write_mesh(Path(settings.world_path), self._simulation.world.vertices, self._simulation.world.triangles)
        self._pacer = Pacer(settings.pace_topics, limit_s=settings.pace_limit_s, timeout_s=settings.pace_timeout_s)
        self._pilot_words: queue.SimpleQueue[str] = queue.SimpleQueue()
        # Holds more ticks than a pace limit lets through at once, so a paced run loses none; flat out, the oldest may be dropped.
        self._clock = rospy.Publisher("/clock", Clock, queue_size=100)
        self._pose = rospy.Publisher("/sim/true_pose", PoseStamped, queue_size=5)
        self._state = rospy.Publisher("/sim/state", String, queue_size=5, latch=True)
        self._tf_static = rospy.Publisher("/tf_static", TFMessage, queue_size=1, latch=True)
        self._drivers = Drivers(self._simulation, self._pacer.measured)
        self._pose_due_ns = self._state_due_ns = 0
        self._last_state = self._simulation.state
        self._left_out: list[str] = []
        self._held = False
        self._late_told_s = -LATE_TOLD_S
        self._stopping = StopEvent()
        for name, port in self._pilot.ports.items():
            rospy.set_param(f"~{name}", port)
        rospy.Service("/sim/set_sensor", SetSensor, self._on_set_sensor)
        rospy.Subscriber("/sim/pilot", String, lambda m: self._pilot_words.put(m.data))
        paced = {topic: against for topic, _, against in (word.partition("=") for word in settings.pace_topics)}
        self._only_at_start = frozenset(topic for topic, against in paced.items() if against == "inf")
        self._heard_at_start: set[str] = set()
        self._paced = {
            topic: rospy.Subscriber(topic, rospy.AnyMsg, self._on_paced, callback_args=topic, tcp_nodelay=True) for topic in paced
        }

    def stop(self) -> None:
        """End ``run`` soon; may be called by a signal's handler."""
        self._stopping.set()

    @property
    def _ended(self) -> bool:
        return self._stopping.is_set() or rospy.is_shutdown()

    def run(self) -> None:
        """Step until ``stop`` or until ROS shuts down."""
        self._tf_static.publish(ros_messages.static_transforms(0))
        first_tick = True
        due = time.monotonic()
        while not self._ended:
            self._obey_pilot()
            if not self._simulation.tick():
                continue  # the body's autopilot has not come so far yet
            if first_tick:
                first_tick = False
                self._begin()
            self._publish()
            if self._settings.rate > 0.0:
                due = max(due + TICK_S / self._settings.rate, time.monotonic() - CATCH_UP_S)
            self._wait(due)
        self._pilot.close()

    def _begin(self) -> None:
        """Hold time at its first tick until all that work for it are there: how long nodes take to start changes no flight.

        A node that has subscribed by then is connected, too, so that perception and recorder miss no first measurement. An
        autopilot that is followed has a clock of its own, which goes on.
        """
        if self._settings.followed_url:
            return
        end = time.monotonic() + self._settings.start_timeout_s
        while (missing := [*self._absent(), *self._unheard(), *unconnected()]) and time.monotonic() < end and not self._ended:
            self._publish_clock()
            again = time.monotonic() + START_CLOCK_S
            while (rest := again - time.monotonic()) > 0.0:
                self._pilot.serve(min(rest, self._pilot.nap_s))
        if missing and not self._ended:
            rospy.logwarn(f"simulated time begins without {', '.join(missing)}: not connected for {self._settings.start_timeout_s:g} s")
        self._pacer.begin(self._simulation.now_s)

    def _absent(self) -> list[str]:
        return [topic for topic, subscriber in self._paced.items() if not subscriber.get_num_connections()]

    def _unheard(self) -> list[str]:
        return sorted(self._only_at_start - self._heard_at_start)

    def _wait(self, due: float) -> None:
        """Serve the link until wall time and the paced topics have come far enough."""
        while not self._ended:
            now = time.monotonic()
            self._held = True  # before it is asked: what is heard from here on ends the nap
            self._held = held = not self._late and not self._pacer.may_advance(self._simulation.now_s, now)
            if held:
                self._leave_out_the_dead()
            rest = max(due - now, self._pilot.nap_s if held else 0.0)
            self._pilot.serve(rest)
            if not held and rest <= 0.0:
                break
        self._tell_left_out()

    def _publish(self) -> None:
        """Publish the tick's clock, truth and measurements."""
        simulation = self._simulation
        self._pilot.serve()  # an answer to the new state may leave before the images are made
        self._publish_clock()
        if simulation.now_ns >= self._pose_due_ns:
            self._pose_due_ns += POSE_PERIOD_NS
            self._pose.publish(ros_messages.pose_stamped(simulation.pose, simulation.now_ns))
        self._publish_state()
        self._drivers.publish_due(late=self._late)

    @property
    def _late(self) -> bool:
        late_s = self._simulation.flown.late_s(self._simulation.now_s)
        if late_s > LATE_S and time.monotonic() - self._late_told_s >= LATE_TOLD_S:
            self._late_told_s = time.monotonic()
            rospy.logwarn(f"{late_s:.2f} s behind the autopilot, which does not wait: images and sweeps are dropped; slow it down")
        return late_s > LATE_S

    def _publish_clock(self) -> None:
        self._clock.publish(Clock(clock=ros_messages.ros_time(self._simulation.now_ns)))

    def _publish_state(self) -> None:
        """Publish the state once a second, and at once when something other than time, way and clearance has changed."""
        state = self._simulation.state
        last = replace(self._last_state, t_s=state.t_s, distance_m=state.distance_m, min_clearance_m=state.min_clearance_m)
        if self._simulation.now_ns >= self._state_due_ns or state != last:
            self._state_due_ns = self._simulation.now_ns + STATE_PERIOD_NS
            self._state.publish(String(json.dumps(asdict(state))))
        self._last_state = state

    def _obey_pilot(self) -> None:
        while not self._pilot_words.empty():
            try:
                self._pilot.obey(self._pilot_words.get())
            except ConfigError as error:
                rospy.logwarn(str(error))

    def _on_set_sensor(self, request: SetSensorRequest) -> SetSensorResponse:
        try:
            self._simulation.sensors.set(request.sensor, request.mode, self._simulation.now_s)
        except ConfigError as error:
            return SetSensorResponse(accepted=False, reason=str(error))
        return SetSensorResponse(accepted=True, reason="")

    def _on_paced(self, message: rospy.AnyMsg, topic: str) -> None:
        if topic in self._only_at_start:
            self._heard_at_start.add(topic)  # it may be of a type without a header
            return
        self._pacer.heard(topic, header_stamp_s(message._buff))  # noqa: SLF001 - AnyMsg has no other access to its bytes
        if self._held:
            self._pilot.wake()

    def _leave_out_the_dead(self) -> None:
        for topic in self._absent():
            self._pacer.gone(topic)

    def _tell_left_out(self) -> None:
        left_out = self._pacer.left_out
        for topic in set(left_out) - set(self._left_out):
            silent = f"silent for {self._settings.pace_timeout_s:g} s" if self._paced[topic].get_num_connections() else "its node has gone"
            rospy.logwarn(f"simulated time no longer waits for {topic}: {silent}")
        self._left_out = left_out


def main() -> None:
    """Run the node until ROS ends it; a wrong parameter ends it with one line."""
    send_directly()
    # Not rospy's own handlers: they close connections inside the signal's handler, and wait for ever when the signal
    # interrupts the main thread in the middle of a publish, which here is where it nearly always is.
    rospy.init_node("uav_simulator", disable_signals=True)
    try:
        node = SimulatorNode(settings_from_params(rospy.get_param("~", {})))
    except (SimulatorError, FaultError) as error:
        rospy.logfatal(str(error))
        raise SystemExit(2) from error
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: node.stop())
    node.run()
    rospy.signal_shutdown("the simulation has been ended")
