"""The node /zed_depth: health always, depth image and obstacle while enabled."""

from __future__ import annotations

from threading import Lock

import cv2
import numpy as np
import rospy
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Header
from uav_msgs.msg import Obstacle

from perception_core import NS
from perception_core.ros import (
    DoneReporter,
    EnableSwitch,
    HealthReporter,
    NewestWorker,
    Vehicle,
    depth_message,
    image_to_array,
    obstacle_message,
    read_settings,
)
from zed_depth.ahead import obstacle_ahead
from zed_depth.pairing import Pairing, PairJudge, StereoPair
from zed_depth.settings import ZedSettings
from zed_depth.stereo import StereoGeometry, StereoMatcher, depth_of

IMAGE_BYTES = 1 << 22


class ZedDepthNode:
    """Convert in, call the core, publish out."""

    def __init__(self, settings: ZedSettings) -> None:
        self._settings = settings
        self._matcher = StereoMatcher(settings.matcher)
        self._pairing = Pairing(tolerance_s=settings.sync_tolerance_s)
        self._judge = PairJudge(settings.images)
        self._lock = Lock()
        self._projections: dict[str, np.ndarray[tuple[int, int], np.dtype[np.float64]]] = {}
        self._frame = ""
        self._depth = rospy.Publisher("~depth", Image, queue_size=1)
        self._obstacle = rospy.Publisher("~obstacle", Obstacle, queue_size=1, tcp_nodelay=True)
        self._done = DoneReporter()
        self._vehicle = Vehicle()
        self._health = HealthReporter("zed", resource="zed_status", limits=settings.health)
        self._worker = NewestWorker[StereoPair](self._process)
        self._switch = EnableSwitch(enabled=settings.enabled)
        self._subscribers = [self._subscribe(side) for side in ("left", "right")]

    def _subscribe(self, side: str) -> tuple[rospy.Subscriber, rospy.Subscriber]:
        return (
            rospy.Subscriber(f"/zed/{side}/camera_info", CameraInfo, self._on_info, side, queue_size=1),
            rospy.Subscriber(f"/zed/{side}/image_raw", Image, self._on_image, side, queue_size=1, buff_size=IMAGE_BYTES, tcp_nodelay=True),
        )

    def _on_info(self, message: CameraInfo, side: str) -> None:
        self._projections[side] = np.array(message.P, dtype=np.float64).reshape(3, 4)

    def _on_image(self, message: Image, side: str) -> None:
        try:
            image = image_to_array(message)
        except ValueError as error:
            self._health.bad(f"{side} image: {error}")
            return
        with self._lock:
            self._frame = message.header.frame_id if side == "left" else self._frame
            pair = self._pairing.add(side, message.header.stamp.to_nsec(), image)
            apart_s = self._pairing.apart_s()
            complaint = self._judge.complaint(pair) if pair is not None else ""
        if pair is not None and not complaint:
            self._health.good(pair.stamp_ns)
            if self._switch.enabled:
                self._worker.offer(pair)
                return
        elif complaint:
            self._health.bad(complaint)
        elif apart_s > self._settings.sync_tolerance_s:
            self._health.bad(f"left and right images are {apart_s:.2f} s apart")
        if pair is not None:
            self._done.done(pair.stamp_ns)

    def _process(self, pair: StereoPair) -> None:
        try:
            self._look_ahead(pair)
        finally:
            self._done.done(pair.stamp_ns)

    def _look_ahead(self, pair: StereoPair) -> None:
        if len(self._projections) < 2:
            rospy.logwarn_throttle(5.0, "images, but no camera_info of both sides yet")
            return
        geometry = StereoGeometry.from_projections(self._projections["left"], self._projections["right"])
        depth = depth_of(self._matcher.disparity(pair.left, pair.right), geometry)
        stamp = rospy.Time(pair.stamp_ns // NS, pair.stamp_ns % NS)
        if self._depth.get_num_connections():
            self._depth.publish(depth_message(Header(stamp=stamp, frame_id=self._frame), depth))
        nearest = obstacle_ahead(
            depth,
            pair.stamp_ns,
            geometry=geometry,
            T_base_camera=self._vehicle.mount(self._frame),
            poses=self._vehicle.poses_at(pair.stamp_ns),
            motion=self._vehicle.motion,
            settings=self._settings.ahead,
        )
        if self._switch.enabled:
            self._obstacle.publish(obstacle_message(pair.stamp_ns, "zed", nearest))


def main() -> None:
    """Run the node until ROS shuts down."""
    rospy.init_node("zed_depth")
    settings = read_settings(ZedSettings())
    cv2.setNumThreads(settings.threads)
    _node = ZedDepthNode(settings)
    rospy.spin()
