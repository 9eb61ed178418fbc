"""Navigation's node: /move_base, /follow_corridor, /creep and /dock, each a move_base_msgs/MoveBaseAction; the newest goal counts."""

from __future__ import annotations

import threading
from collections.abc import Callable
from functools import partial

import actionlib
import numpy as np
import rospy
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped, Twist
from move_base_msgs.msg import MoveBaseAction, MoveBaseFeedback, MoveBaseGoal
from nav_msgs.msg import Odometry, Path
from resource_reporter import DoneReporter
from sensor_msgs.msg import BatteryState, LaserScan
from std_msgs.msg import Bool, Header

from rover_navigation.geometry import Points, Pose, compose, inverse
from rover_navigation.health import LaserMonitor
from rover_navigation.jobs import Corridor, Creep, Dock, Drive, Ended, Job, Situation
from rover_navigation.planning import Surroundings
from rover_navigation.ros import free_of_scan, points_of_scan, pose_message, pose_of, wait_for_map

FEEDBACK_STEPS = 4  # odometries
REMEMBERED = 20  # odometries, for the poses of localisation that belong to them
LOOK_S = 0.05  # wall clock: how often a waiting goal looks for its preemption
JUMP_M = 0.5  # a correction of the pose by more: what was seen from the pose before is in wrong places


class NavigationNode:
    """Steps the job with every odometry. Parameter ~dock: the pose (x, y, yaw) on the dock."""

    def __init__(self) -> None:
        self._around = Surroundings(wait_for_map())
        dock: Pose = tuple(rospy.get_param("~dock"))
        makers: dict[str, Callable[[Pose], Job]] = {
            "move_base": lambda goal: Drive(self._around, goal),
            "follow_corridor": Corridor,
            "creep": lambda goal: Creep(self._around, goal),
            "dock": lambda _goal: Dock(self._around, dock),
        }
        self._lock = threading.Lock()
        self._job: Job | None = None
        self._ended: Ended | None = None
        self._steps = 0
        self._T_map_odom: Pose | None = None
        self._odom: Pose | None = None
        self._odoms: dict[int, Pose] = {}  # by their stamps, in nanoseconds
        self._points: Points = np.zeros((0, 2))
        self._scan_s = np.inf  # until the first odometry
        self._laser = LaserMonitor()
        self._bumped = self._charging = False
        self._commands = rospy.Publisher("/cmd_vel", Twist, queue_size=5)
        self._way = rospy.Publisher("/move_base/plan", Path, queue_size=2, latch=True)
        self._servers = {
            name: actionlib.SimpleActionServer(name, MoveBaseAction, partial(self._execute, name, make), auto_start=False)
            for name, make in makers.items()
        }
        rospy.Subscriber("/localization/pose", PoseWithCovarianceStamped, self._on_pose, queue_size=5, tcp_nodelay=True)
        rospy.Subscriber("/scan", LaserScan, self._on_scan, queue_size=2, tcp_nodelay=True)
        rospy.Subscriber("/bumper", Bool, self._on_bumper, queue_size=5)
        rospy.Subscriber("/battery_state", BatteryState, self._on_battery, queue_size=5)
        self._scans = rospy.Publisher(
            "~scans", Header, queue_size=20, tcp_nodelay=True
        )  # up to which scan it has come, as ~done of all else
        self._done = DoneReporter()
        rospy.Subscriber("/odom", Odometry, self._on_odometry, queue_size=20, tcp_nodelay=True)
        for server in self._servers.values():
            server.start()

    # --- goals, each in the thread of its server ----------------------------------------------------------------------

    def _execute(self, name: str, make: Callable[[Pose], Job], goal: MoveBaseGoal) -> None:
        """Have the job done; return when it has ended or was preempted: by its client, or by a goal of another action."""
        server, frame = self._servers[name], goal.target_pose.header.frame_id
        if frame not in {"map", ""}:
            server.set_aborted(text=f"the goal's frame is '{frame}'; give it in map")
            return
        job = make(pose_of(goal.target_pose.pose))
        self._begin(job)
        while not rospy.is_shutdown():
            with self._lock:
                if self._job is not job:
                    server.set_preempted(text="another goal has come")
                    return
                ended = self._ended
                if ended is not None:
                    self._job = None
                    (server.set_succeeded if ended.arrived else server.set_aborted)(text=ended.text)
                    return
                if server.is_preempt_requested():
                    self._job = None
                    self._commands.publish(Twist())
                    server.set_preempted(text="preempted")
                    return
            threading.Event().wait(LOOK_S)

    def _begin(self, job: Job) -> None:
        with self._lock:
            self._job, self._ended = job, None

    # --- measurements -------------------------------------------------------------------------------------------------

    def _on_pose(self, message: PoseWithCovarianceStamped) -> None:
        with self._lock:
            odom = self._odoms.get(message.header.stamp.to_nsec())
            if odom is None:
                return  # of a moment that this node has not seen
            before, self._T_map_odom = self._T_map_odom, compose(pose_of(message.pose.pose), inverse(odom))
            if before is not None and np.hypot(self._T_map_odom[0] - before[0], self._T_map_odom[1] - before[1]) > JUMP_M:
                self._around.forget()

    def _on_scan(self, scan: LaserScan) -> None:
        self._take(scan)
        self._scans.publish(Header(stamp=scan.header.stamp))

    def _take(self, scan: LaserScan) -> None:
        with self._lock:
            self._laser.scan(np.asarray(scan.ranges, dtype=np.float64), scan.header.stamp.to_sec())
            if self._laser.repeats:
                return
            self._points, self._scan_s = points_of_scan(scan), scan.header.stamp.to_sec()
            if self._pose is not None:
                self._around.look(self._pose, self._points, free_of_scan(scan), self._scan_s)

    def _on_bumper(self, message: Bool) -> None:
        self._bumped = message.data

    def _on_battery(self, message: BatteryState) -> None:
        self._charging = message.power_supply_status == BatteryState.POWER_SUPPLY_STATUS_CHARGING

    @property
    def _pose(self) -> Pose | None:
        return None if self._T_map_odom is None or self._odom is None else compose(self._T_map_odom, self._odom)

    def _on_odometry(self, message: Odometry) -> None:
        """Step the job."""
        with self._lock:
            self._odom = self._odoms[message.header.stamp.to_nsec()] = pose_of(message.pose.pose)
            if len(self._odoms) > REMEMBERED:
                del self._odoms[next(iter(self._odoms))]
            self._steps += 1
            now_s = message.header.stamp.to_sec()
            self._scan_s = min(self._scan_s, now_s)  # a scan that has never come is missing from the beginning on
            if self._job is not None and self._ended is None and self._pose is not None:
                age_s = now_s - self._scan_s
                situation = Situation(now_s, self._pose, self._odom, self._points, age_s, self._bumped, self._charging)
                self._step(self._job, situation)
        self._done.done(message.header.stamp.to_nsec())

    def _step(self, job: Job, situation: Situation) -> None:
        done = job.step(situation)
        command = Twist()
        if isinstance(done, Ended):
            self._ended = done
        else:
            command.linear.x, command.angular.z = done
        self._commands.publish(command)
        if self._steps % FEEDBACK_STEPS == 0:
            self._tell(job, situation)

    def _tell(self, job: Job, situation: Situation) -> None:
        header = Header(stamp=rospy.Time.from_sec(situation.now_s), frame_id="map")
        feedback = MoveBaseFeedback(base_position=PoseStamped(header, pose_message(situation.pose)))
        for server in self._servers.values():
            if server.is_active():
                server.publish_feedback(feedback)
        way = getattr(job, "way", None)
        if way is not None:
            self._way.publish(Path(header, [PoseStamped(header, pose_message((x, y, 0.0))) for x, y in way[::5].tolist()]))


def main() -> None:
    """Run the node until ROS shuts down."""
    rospy.init_node("navigation")
    _node = NavigationNode()
    rospy.spin()
