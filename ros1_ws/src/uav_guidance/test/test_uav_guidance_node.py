"""The node on a live graph, with a real MAVLink peer that moves the clock five times as fast as the wall's."""

from __future__ import annotations

import math
import os
import subprocess
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path

import pytest

rospy = pytest.importorskip("rospy")

from dynamic_reconfigure.client import Client  # noqa: E402
from dynamic_reconfigure.encoding import encode_config  # noqa: E402
from dynamic_reconfigure.msg import Config  # noqa: E402
from dynamic_reconfigure.srv import Reconfigure  # noqa: E402
from geometry_msgs.msg import Point, PoseStamped, Quaternion, TransformStamped, Vector3  # noqa: E402
from guidance_fake_autopilot import GUIDED, LAND, LOITER, FakeAutopilot  # noqa: E402
from rosgraph_msgs.msg import Clock  # noqa: E402
from skillset_interfaces.msg import ResourceState, ResourceStates  # noqa: E402
from skillset_interfaces.srv import Transition, TransitionRequest, TransitionResponse  # noqa: E402
from std_msgs.msg import Header  # noqa: E402
from tf2_msgs.msg import TFMessage  # noqa: E402
from uav_msgs.msg import GuidanceState, MappingState, Obstacle  # noqa: E402
from uav_msgs.srv import (  # noqa: E402
    CheckFence,
    Command,
    SetHeadingReference,
    SetPositionReference,
    SetPositionReferenceRequest,
    Takeoff,
)

from alula_testing.ros1 import StartNode, end_process  # noqa: E402
from alula_testing.waits import HANGS_S, until  # noqa: E402
from perception_core.testing import framed, send_raw  # noqa: E402

SOURCES = Path(__file__).resolve().parents[2]
PACE_S = 0.15  # three steps of the guidance
KEEP, ALONG = SetPositionReferenceRequest.KEEP, SetPositionReferenceRequest.ALONG_TRAVEL


class Bench:
    """One flight: autopilot, node, and a navigation skillset that accepts every transition."""

    def __init__(self, start_node: StartNode) -> None:
        self._start_node = start_node
        self.states: list[GuidanceState] = []
        self.poses: list[PoseStamped] = []
        self.resources = {"SDK_authority": "UNAVAILABLE", "flight_status": "ON_GROUND", "homepoint_status": "INVALID"}
        self.reasons: dict[str, str] = {}
        self.transitions: list[tuple[str, str]] = []
        self.sees: Callable[[], float | None] | None = None
        """What a sensor tells with each state of the guidance: how far an obstacle is, metres."""
        self.done_s: float | None = None
        """Up to when the guidance is done, None until it tells: time waits for it, as the simulator's does. Its state's stamps can't be
        waited for: they lag behind where messages were held up."""
        self._clock = rospy.Publisher("/clock", Clock, queue_size=10)
        self.autopilot = FakeAutopilot(on_clock=lambda now_s: self._clock.publish(rospy.Time.from_sec(now_s)))
        self.autopilot.keep_pace = lambda: self.done_s is None or self.autopilot.now_s - self.done_s < PACE_S
        self._shown = rospy.Publisher("/navigation/resource_states", ResourceStates, queue_size=10, latch=True)
        self._service = rospy.Service("/navigation/transition", Transition, self._take_transition)
        self.obstacles = rospy.Publisher("/zed_depth/obstacle", Obstacle, queue_size=10)
        self._subscribers = [
            rospy.Subscriber("/uav_guidance/state", GuidanceState, self._take_state),
            rospy.Subscriber("/uav_guidance/pose", PoseStamped, self.poses.append),
            rospy.Subscriber("/uav_guidance/done", Header, self._take_done),
        ]
        self._show()
        rospy.set_param("/use_sim_time", True)
        rospy.set_param("/uav_guidance", {"url": self.autopilot.url})
        self.node = self.run_node()
        # The clock starts late, as it does when the simulator takes longer to come up than the node.
        rospy.wait_for_service("/uav_guidance/check_fence", timeout=HANGS_S)
        self.autopilot.start()

    def run_node(self) -> subprocess.Popen[bytes]:
        self.done_s = None
        path = os.environ.get("PYTHONPATH", "")
        os.environ["PYTHONPATH"] = ":".join([str(SOURCES / "uav_guidance/src"), str(SOURCES / "resource_reporter/src"), path])
        self.node = self._start_node(["python3", str(SOURCES / "uav_guidance/scripts/uav_guidance_node")])
        os.environ["PYTHONPATH"] = path
        return self.node

    @property
    def state(self) -> GuidanceState:
        return self.states[-1] if self.states else GuidanceState()

    def until(self, condition: Callable[[GuidanceState], bool], what: str, timeout_s: float = HANGS_S) -> None:
        until(lambda: bool(self.states) and condition(self.state), timeout_s=timeout_s, what=what)

    def call(self, name: str, kind: type, *arguments: object) -> object:
        rospy.wait_for_service(f"/uav_guidance/{name}", timeout=HANGS_S)
        return rospy.ServiceProxy(f"/uav_guidance/{name}", kind)(*arguments)

    def take_off(self, height_m: float = 3.0) -> None:
        self.until(lambda s: s.authority and s.ready and s.home_valid, "the companion has the authority")
        answer = self.call("takeoff", Takeoff, height_m, 1.5)
        assert answer.accepted, answer.reason
        self.until(lambda s: s.landed_state == 2 and s.distance_to_go_m < 0.2, "at altitude")

    def show_obstacle(self, distance_m: float | None) -> None:
        message = Obstacle(source="zed", detected=distance_m is not None, distance_m=math.inf if distance_m is None else distance_m)
        message.header.stamp = rospy.Time.from_sec(self.autopilot.now_s)
        self.obstacles.publish(message)

    def close(self) -> None:
        end_process(self.node)
        self.autopilot.close()
        for subscriber in self._subscribers:
            subscriber.unregister()
        for publisher in (self._clock, self._shown, self.obstacles):
            publisher.unregister()
        self._service.shutdown()
        rospy.set_param("/use_sim_time", False)
        rospy.delete_param("/uav_guidance")

    def _take_state(self, state: GuidanceState) -> None:
        if self.sees is not None:
            self.show_obstacle(self.sees())
        self.states.append(state)

    def _take_done(self, done: Header) -> None:
        self.done_s = done.stamp.to_sec()

    def _take_transition(self, request: TransitionRequest) -> TransitionResponse:
        self.reasons[request.resource] = request.reason
        if self.resources[request.resource] == request.to:
            self._show()
            return TransitionResponse(False, "it is so already", request.to)
        self.transitions.append((request.resource, request.to))
        self.resources[request.resource] = request.to
        self._show()
        return TransitionResponse(True, "", request.to)

    def _show(self) -> None:
        resources = [ResourceState(name=name, state=state, reason=self.reasons.get(name, "")) for name, state in self.resources.items()]
        self._shown.publish(ResourceStates(skillset="navigation", resources=resources))


class Mapping:
    """A mapping beside the flight: tells T_map_odom, a shift, each time that the guidance tells its state."""

    def __init__(self) -> None:
        self.shift = Vector3(0.0, 0.0, 0.0)
        self.problem = ""
        self.heard: list[TransformStamped] = []
        self._states = rospy.Publisher("/lidar_mapping/state", MappingState, queue_size=5, latch=True)
        self._transforms = rospy.Publisher("/tf", TFMessage, queue_size=5)
        self._subscribers = [
            rospy.Subscriber("/uav_guidance/state", GuidanceState, self._tell),
            rospy.Subscriber("/tf", TFMessage, self._hear),
        ]

    @property
    def guidance_map(self) -> Vector3:
        """Where the origin of the map that the guidance flies by lies in odom."""
        return next(t.transform.translation for t in reversed(self.heard) if t.child_frame_id == "guidance_map")

    def close(self) -> None:
        for each in (*self._subscribers, self._states, self._transforms):
            each.unregister()

    def _tell(self, state: GuidanceState) -> None:
        transform = TransformStamped(header=Header(stamp=state.header.stamp, frame_id="map"), child_frame_id="odom")
        transform.transform.translation, transform.transform.rotation = self.shift, Quaternion(0.0, 0.0, 0.0, 1.0)
        self._transforms.publish(TFMessage(transforms=[transform]))
        self._states.publish(MappingState(header=Header(stamp=state.header.stamp), running=True, problem=self.problem))

    def _hear(self, message: TFMessage) -> None:
        self.heard.extend(message.transforms)


@pytest.fixture
def mapping() -> Iterator[Mapping]:
    mapping = Mapping()
    yield mapping
    mapping.close()


@pytest.fixture
def bench(start_node: StartNode) -> Iterator[Bench]:
    bench = Bench(start_node)
    yield bench
    bench.close()


def test_whole_mission_leaves_the_golden_transcript(bench):
    bench.take_off(3.0)
    assert bench.autopilot.enu[2] == pytest.approx(3.0, abs=0.3)

    answer = bench.call("set_position", SetPositionReference, Point(6.0, 0.0, 3.0), 1.5, ALONG)
    assert answer.accepted, answer.reason
    bench.until(lambda s: s.reference_id == answer.reference_id and s.distance_to_go_m < 0.2, "at the waypoint")
    assert bench.autopilot.enu == pytest.approx((6.0, 0.0, 3.0), abs=0.3)
    assert bench.state.yaw_rad == pytest.approx(0.0, abs=0.1)

    assert bench.call("set_heading", SetHeadingReference, math.pi / 2, 0.8, True, False).accepted
    bench.until(lambda s: s.heading_locked and abs(s.heading_error_rad) < 0.05, "the heading is locked")
    answer = bench.call("set_position", SetPositionReference, Point(2.0, 0.0, 3.0), 1.0, KEEP)
    bench.until(lambda s: s.reference_id == answer.reference_id and s.distance_to_go_m < 0.2, "back, sideways")
    assert bench.state.yaw_rad == pytest.approx(math.pi / 2, abs=0.05)
    assert bench.call("set_heading", SetHeadingReference, 0.0, 0.0, False, True).accepted

    assert bench.call("hover", Command).accepted
    bench.until(lambda s: s.reference == "hover" and not s.heading_locked, "hovering")
    assert bench.call("land", Command).accepted
    bench.until(lambda s: s.reference == "land" and s.landed_state == 1 and not s.armed, "landed and disarmed")
    assert bench.state.distance_to_go_m == 0.0

    assert bench.autopilot.transcript == [
        ("MAV_CMD_DO_SET_MODE", 1.0, GUIDED, 0.0),
        ("MAV_CMD_COMPONENT_ARM_DISARM", 1.0, 0.0, 0.0),
        ("MAV_CMD_NAV_TAKEOFF", 0.0, 0.0, 3.0),
        ("setpoints", "0x9f8", 2),
        ("MAV_CMD_DO_SET_MODE", 1.0, LAND, 0.0),
    ]
    until(lambda: bench.resources["flight_status"] == "ON_GROUND", what="the skillset knows of the landing")
    assert [state for name, state in bench.transitions if name == "flight_status"] == ["IN_AIR", "ON_GROUND"]
    assert ("SDK_authority", "AVAILABLE") in bench.transitions
    assert ("homepoint_status", "VALID") in bench.transitions
    assert bench.autopilot.heartbeats_heard >= 10


def test_pilot_takes_over_and_nothing_is_taken_back(bench):
    bench.take_off()
    assert bench.call("set_position", SetPositionReference, Point(20.0, 0.0, 3.0), 1.5, KEEP).accepted
    bench.until(lambda s: s.position_enu_m.x > 1.0, "under way")
    bench.autopilot.pilot(LOITER)
    bench.until(lambda s: not s.authority and s.reference == "idle" and s.mode == "LOITER", "taken over")
    until(lambda: bench.resources["SDK_authority"] == "UNAVAILABLE", what="the skillset knows it")
    sent = len(bench.autopilot.transcript)
    before_s = bench.autopilot.now_s
    refused = bench.call("set_position", SetPositionReference, Point(1.0, 0.0, 3.0), 1.5, KEEP)
    assert not refused.accepted
    assert "LOITER" in refused.reason
    bench.until(lambda s: s.header.stamp.to_sec() > before_s + 5.0, "five seconds with the pilot")
    assert len(bench.autopilot.transcript) == sent
    assert bench.call("take_authority", Command).accepted
    bench.until(lambda s: s.authority and s.reference == "hover", "the operator gave it back")


def test_fence_and_limits_refuse(bench):
    bench.until(lambda s: s.home_valid, "home is known")
    assert bench.call("check_fence", CheckFence, Point(10.0, 0.0, 3.0)).inside
    outside = bench.call("check_fence", CheckFence, Point(60.1, 0.0, 3.0))
    assert not outside.inside
    assert "60.1 m from home" in outside.reason
    assert not bench.call("set_position", SetPositionReference, Point(1.0, 0.0, 3.0), 1.5, KEEP).accepted
    bench.until(lambda s: s.authority, "the companion has the authority")
    bench.autopilot.refuse_arming = "Compass not calibrated"
    refused = bench.call("takeoff", Takeoff, 3.0, 3.1)
    assert (refused.accepted, refused.reason) == (False, "speed is 3.1: at most 3 is allowed")
    refused = bench.call("takeoff", Takeoff, 3.0, 1.5)
    assert not refused.accepted
    assert "Arm: Compass not calibrated" in refused.reason
    bench.until(lambda s: s.reference == "idle", "the take-off is given up")


def test_parameters_are_changed_in_flight_and_refused_out_of_range(bench):
    told: list[Config] = []
    subscriber = rospy.Subscriber("/uav_guidance/parameter_updates", Config, told.append)
    client = Client("/uav_guidance", timeout=20.0)
    bench.until(lambda s: s.home_valid, "home is known")
    assert client.update_configuration({"fence_radius_m": 10.0})["fence_radius_m"] == 10.0
    assert "20.0 m from home, at most 10 m" in bench.call("check_fence", CheckFence, Point(20.0, 0.0, 3.0)).reason
    until(lambda: any(p.value == 10.0 for c in told for p in c.doubles if p.name == "fence_radius_m"), what="it is told")
    with pytest.raises(rospy.ServiceException, match=r"~max_speed_m_s is 3\.5, expected 0\.1 to 3 "):
        bench.call("set_parameters", Reconfigure, encode_config({"max_speed_m_s": 3.5, "fence_radius_m": 50.0}))
    assert rospy.get_param("/uav_guidance/fence_radius_m") == 10.0
    client.close()
    subscriber.unregister()


def test_obstacle_stops_it_and_it_goes_on_when_clear(bench):
    bench.take_off()
    obstacle_at = 5.0

    def sees() -> float | None:  # on a busy machine, too, where the vehicle is, and not when this thread looks
        distance_m = obstacle_at - bench.autopilot.enu[0]
        return max(0.1, distance_m) if distance_m < 2.9 else None

    send_raw(bench.obstacles, framed(bytes(20)))  # cut short on the wire: those after it count all the same
    bench.sees = sees
    assert bench.call("set_position", SetPositionReference, Point(15.0, 0.0, 3.0), 1.5, KEEP).accepted
    bench.until(lambda s: s.obstacle_stop and s.obstacle_m < 3.0, "it sees the obstacle")
    bench.until(lambda s: s.obstacle_stop and s.still_s > 3.0, "held back, and it counts as still")
    assert bench.autopilot.enu[0] < obstacle_at - 1.0
    bench.sees = lambda: None
    bench.until(lambda s: not s.obstacle_stop and s.position_enu_m.x > obstacle_at, "going on")
    bench.sees = None
    bench.until(lambda s: s.unwatched and s.obstacle_stop, "no sensor watches any more")


def test_reconnects_and_asks_for_its_streams_again(bench):
    bench.take_off()
    bench.autopilot.drop_client()
    poses = len(bench.poses)
    until(lambda: len(bench.poses) > poses + 20, what="poses arrive again")
    bench.until(lambda s: s.authority and s.landed_state == 2, "it still flies")


def test_what_it_is_done_with_is_told_whether_the_autopilot_speaks_or_not(bench):
    done: list[float] = []
    listener = rospy.Subscriber("/uav_guidance/done", Header, lambda m: done.append(m.stamp.to_sec()))
    bench.until(lambda s: s.link and s.home_valid and bool(done), "the autopilot speaks")
    autopilot = bench.autopilot
    for change in (lambda: None, autopilot.drop_client, autopilot.forget_streams, autopilot.close_port, autopilot.open_port):
        change()
        begin_s = bench.autopilot.now_s
        until(lambda begin_s=begin_s: done[-1] > begin_s + 2.0, what="two seconds are done with")
    assert all(a < b for a, b in pairwise(done)), done
    listener.unregister()


def test_respawned_in_flight_it_hovers_where_it_is(bench):
    bench.take_off()
    assert bench.call("set_position", SetPositionReference, Point(15.0, 0.0, 3.0), 1.0, KEEP).accepted
    bench.until(lambda s: s.position_enu_m.x > 2.0, "under way")
    bench.node.kill()
    bench.node.wait()
    bench.states.clear()
    sent = [entry for entry in bench.autopilot.transcript if entry[0] != "setpoints"]
    bench.run_node()
    bench.until(lambda s: s.authority and s.reference == "hover", "hovering after the restart")
    assert [entry for entry in bench.autopilot.transcript if entry[0] != "setpoints"] == sent
    assert bench.call("land", Command).accepted
    bench.until(lambda s: s.landed_state == 1 and not s.armed, "landed")


def test_flies_by_the_map_and_its_pose_stays_the_autopilots(bench, mapping):
    bench.take_off()
    mapping.shift = Vector3(0.0, 0.8, 0.0)
    answer = bench.call("set_position", SetPositionReference, Point(6.0, 0.0, 3.0), 1.5, KEEP)
    bench.until(lambda s: s.reference_id == answer.reference_id and s.distance_to_go_m < 0.1, "at the place of the map")
    bench.until(lambda _: abs(mapping.guidance_map.y + 0.8) < 0.001, "the correction is followed to its end")
    until(lambda: bench.autopilot.enu == pytest.approx((6.0, -0.8, 3.0), abs=0.15), what="there")
    assert bench.state.position_enu_m.y == pytest.approx(0.0, abs=0.15)
    assert bench.poses[-1].pose.position.y == pytest.approx(-0.8, abs=0.15)
    assert (bench.state.header.frame_id, bench.poses[-1].header.frame_id) == ("map", "odom")
    assert {(t.header.frame_id, t.child_frame_id) for t in mapping.heard} == {
        ("map", "odom"),
        ("odom", "base_link"),
        ("odom", "guidance_map"),
    }

    mapping.problem = "no scan fitted the map for 2.1 s"
    bench.until(lambda s, from_s=bench.autopilot.now_s: s.header.stamp.to_sec() > from_s + 1.0, "the mapping is lost")
    mapping.shift = Vector3(30.0, 0.0, 0.0)
    bench.until(lambda s, from_s=bench.autopilot.now_s: s.header.stamp.to_sec() > from_s + 2.0, "two seconds more")
    assert mapping.guidance_map.y == pytest.approx(-0.8)

    mapping.problem, mapping.shift = "", Vector3(0.0, 0.8, 0.0)
    client = Client("/uav_guidance", timeout=20.0)
    assert client.update_configuration({"follow_map": False})["follow_map"] is False
    bench.until(lambda _: mapping.guidance_map.y == 0.0, "it flies by the autopilot's position")
    client.close()


def test_respawned_in_flight_it_begins_with_the_newest_correction(bench, mapping):
    bench.take_off()
    mapping.shift = Vector3(0.0, 0.8, 0.0)
    bench.until(lambda _: abs(mapping.guidance_map.y + 0.8) < 0.001, "the correction is followed to its end")
    place = bench.autopilot.enu
    bench.node.kill()
    bench.node.wait()
    bench.states.clear()
    mapping.heard.clear()
    bench.run_node()
    bench.until(lambda s: s.authority and s.reference == "hover" and s.position_enu_m.y > -0.2, "hovering, and it knows where")
    followed = {round(t.transform.translation.y, 3) for t in mapping.heard if t.child_frame_id == "guidance_map"}
    assert followed <= {0.0, -0.8}, "at once, not evenly"
    assert math.dist(bench.autopilot.enu, place) < 0.3
