"""The simulator's node: steps simulated time in lockstep with the nodes that work on its measurements, and publishes what happens."""

from __future__ import annotations

import json
import queue
import signal
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import rosgraph
import rospy
from alula import parts
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from resource_reporter import ToldService
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import BatteryState, LaserScan
from std_msgs.msg import Bool, String
from std_srvs.srv import SetBool, SetBoolRequest, SetBoolResponse
from tf2_msgs.msg import TFMessage

from rover_simulator import messages
from rover_simulator.errors import WorldError
from rover_simulator.faults import FAULTS
from rover_simulator.lockstep import Lockstep, ProcessorShare, stamp_s
from rover_simulator.simulation import Simulation
from rover_simulator.world import load_world

SCAN_STEPS, BATTERY_STEPS, STATE_STEPS = 2, 20, 20  # of 50 ms
WAIT_S = 0.001  # wall clock, while time stands still
START_CLOCK_S = 0.05
HANGS_S = 15.0  # wall clock, times the processor's share: a node that hangs is waited for so long, one that has died is not


def unconnected() -> list[str]:
    """Return the topics of this node that more nodes have subscribed to, as the master knows, than are connected to it."""
    _, subscribed, _ = rosgraph.Master(rospy.get_name()).getSystemState()
    nodes = {topic: len(names) for topic, names in subscribed}
    published = rospy.topics.get_topic_manager().pubs
    return [topic for topic, publication in published.items() if publication.get_num_connections() < nodes.get(topic, 0)]


class SimulatorNode:
    """Wires the simulation to ROS. Parameters: ~world, ~seed, ~faults, ~rate, ~lockstep, ~start_timeout_s."""

    def __init__(self) -> None:
        param = rospy.get_param
        faults = parts.parse_faults(param("~faults", ""), FAULTS)
        self._simulation = Simulation(load_world(Path(param("~world"))), seed=int(param("~seed", 0)), faults=faults)
        self._rate = float(param("~rate", 1.0))  # simulated seconds a second at most; 0: as fast as it can
        self._start_timeout_s = float(param("~start_timeout_s", 45.0))
        self._lockstep = Lockstep(str(param("~lockstep", "")).replace(",", " ").split(), HANGS_S)
        self._processor = ProcessorShare()
        self._waited_s = 0.0  # in all: by it a node hangs
        self._steps = 0
        self._told = ""
        self._left_out: list[str] = []
        self._stopping = parts.StopEvent()
        self._inbox: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()  # what other threads want done between two steps
        self._clock = rospy.Publisher("/clock", Clock, queue_size=20)
        self._odom = rospy.Publisher("/odom", Odometry, queue_size=20)
        self._truth = rospy.Publisher("/truth/odom", Odometry, queue_size=20)
        self._tf = rospy.Publisher("/tf", TFMessage, queue_size=20)
        self._tf_static = rospy.Publisher("/tf_static", TFMessage, queue_size=1, latch=True)
        self._scan = rospy.Publisher("/scan", LaserScan, queue_size=10)
        self._bumper = rospy.Publisher("/bumper", Bool, queue_size=10)
        self._battery = rospy.Publisher("/battery_state", BatteryState, queue_size=5, latch=True)
        self._state = rospy.Publisher("/truth/state", String, queue_size=5, latch=True)
        self._answer = rospy.Publisher("/person/answer", String, queue_size=5)
        self._tf_static.publish(TFMessage([messages.transform("base_link", "laser", (0.0, 0.0, 0.0), 0)]))
        rospy.Subscriber("/cmd_vel", Twist, self._on_command, queue_size=5, tcp_nodelay=True)
        rospy.Subscriber("/person/ask", String, self._on_question, queue_size=5)
        for door in self._simulation.floor.doors:
            ToldService(f"/door/{door}/open", SetBool, partial(self._on_door, door))
        self._followers = {
            topic: rospy.Subscriber(topic, rospy.AnyMsg, self._on_done, callback_args=topic, tcp_nodelay=True)
            for topic in self._lockstep.topics
        }

    def stop(self) -> None:
        """End ``run`` soon; may be called by a signal's handler."""
        self._stopping.set()

    @property
    def _ended(self) -> bool:
        return self._stopping.is_set() or rospy.is_shutdown()

    def run(self) -> None:
        """Step until ``stop`` or until ROS shuts down."""
        due_s = time.monotonic()
        while not self._ended:
            while not self._inbox.empty():
                self._inbox.get()()
            if self._steps == 0:
                self._simulation.step()
                self._begin()
                self._publish()
            else:
                self._step()
            rate = self._rate
            if left_out := self._lockstep.left_out:  # a node that is started again takes as long as it does on a robot
                rate = min(rate or 1.0, 1.0) * self._processor.share
            self._tell(left_out)
            if rate > 0.0:
                due_s = max(due_s + self._simulation.floor.period_s / rate, time.monotonic() - 0.25)
            self._wait(due_s)

    def _step(self) -> None:
        wall_s, processor_s = time.monotonic(), time.thread_time()
        self._simulation.step()
        self._publish()
        self._processor.worked(time.monotonic() - wall_s, time.thread_time() - processor_s)

    def _tell(self, left_out: list[str]) -> None:
        if left_out != self._left_out:
            self._left_out = left_out
            told = f"simulated time does not wait for {', '.join(left_out)}" if left_out else "simulated time waits for all again"
            rospy.logwarn(f"{self._simulation.now_s:.2f} s: {told}")

    def _begin(self) -> None:
        """Hold time at its first step until all that work for it are there: how long nodes take to start changes no drive.

        Not at zero, which is no time yet to ROS: a node whose timers begin later than the clock has no tick, and time waits for it.
        """
        end_s = time.monotonic() + self._start_timeout_s
        while (missing := [*self._absent(), *unconnected()]) and time.monotonic() < end_s and not self._ended:
            self._clock.publish(Clock(clock=messages.ros_time(self._simulation.now_ns)))
            self._stopping.wait(START_CLOCK_S)
        if missing and not self._ended:
            rospy.logwarn(f"simulated time begins without {', '.join(missing)}: not there for {self._start_timeout_s:g} s")
        for topic in set(self._lockstep.topics) - set(missing):
            self._lockstep.heard(topic, self._simulation.now_s)

    def _absent(self) -> list[str]:
        return [topic for topic, subscriber in self._followers.items() if not subscriber.get_num_connections()]

    def _wait(self, due_s: float) -> None:
        """Wait until wall clock and followers have come far enough."""
        last_s = time.monotonic()
        again_s = last_s + START_CLOCK_S
        while not self._ended:
            last_s, before_s = time.monotonic(), last_s
            self._waited_s += (last_s - before_s) * self._processor.share
            now_s = last_s
            lagging = self._lockstep.lagging(self._simulation.now_s, self._waited_s)
            if not lagging and now_s >= due_s:
                return
            for topic in set(lagging) & set(self._absent()):
                self._lockstep.gone(topic)
            if now_s >= again_s:  # who has missed the last clock would wait for it, and time for them
                again_s = now_s + START_CLOCK_S
                self._clock.publish(Clock(clock=messages.ros_time(self._simulation.now_ns)))
            time.sleep(WAIT_S if lagging else due_s - now_s)

    def _publish(self) -> None:
        """Publish the step's measurements, the scan before the odometry that consumers step with, and the clock."""
        simulation, now_ns = self._simulation, self._simulation.now_ns
        self._clock.publish(Clock(clock=messages.ros_time(now_ns)))
        if self._steps % SCAN_STEPS == 0 and (sweep := simulation.sweep()) is not None:
            self._lockstep.scanned(simulation.now_s)
            self._scan.publish(messages.scan(sweep, now_ns))
        self._bumper.publish(Bool(simulation.bumper))
        wheels = simulation.wheels
        self._tf.publish(TFMessage([messages.transform("odom", "base_link", wheels.odometry, now_ns)]))
        self._truth.publish(messages.odometry(simulation.floor.pose, wheels.odometry_speed, now_ns, "map"))
        self._odom.publish(messages.odometry(wheels.odometry, wheels.odometry_speed, now_ns, "odom"))
        if self._steps % BATTERY_STEPS == 0:
            self._battery.publish(messages.battery(simulation.battery, now_ns))
        if answer := simulation.person.answer(simulation.now_s, silent=simulation.faults.lasts("person", "silent")):
            self._answer.publish(String(answer))
        self._publish_state()
        self._steps += 1

    def _publish_state(self) -> None:
        """Publish the truth once a second, and at once when something has failed or was touched."""
        truth = self._simulation.truth
        news = f"{truth.departed_s} {truth.collisions} {truth.charging} {truth.doors_open} {truth.faults}"
        if self._steps % STATE_STEPS == 0 or news != self._told:
            self._told = news
            self._state.publish(String(json.dumps(self._simulation.state)))

    def _on_command(self, twist: Twist) -> None:
        self._inbox.put(lambda: self._simulation.wheels.command(twist.linear.x, twist.angular.z, self._simulation.now_s))

    def _on_question(self, question: String) -> None:
        self._inbox.put(lambda: self._simulation.person.ask(question.data, self._simulation.now_s))

    def _on_door(self, name: str, request: SetBoolRequest) -> SetBoolResponse:
        reply: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._inbox.put(lambda: reply.put(self._simulation.open_door(name, wide=request.data)))
        reason = reply.get()
        return SetBoolResponse(success=not reason, message=reason)

    def _on_done(self, message: rospy.AnyMsg, topic: str) -> None:
        self._lockstep.heard(topic, stamp_s(message._buff))


def main() -> None:
    """Run the node until ROS ends it; a wrong parameter ends it with one line."""
    # Not rospy's own handlers: they wait for ever when the signal interrupts the main thread in the middle of a publish.
    rospy.init_node("simulator", disable_signals=True)
    try:
        node = SimulatorNode()
    except (WorldError, parts.FaultError) as error:
        rospy.logfatal(str(error))
        raise SystemExit(2) from error
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: node.stop())
    node.run()
    rospy.signal_shutdown("the simulation has been ended")
