"""The node /zed_depth: health always; depth image, points and obstacle while enabled."""

from __future__ import annotations

from dataclasses import replace
from threading import Lock
from typing import TYPE_CHECKING

import cv2
import numpy as np
import rospy
from sensor_msgs.msg import CameraInfo, Image, PointCloud2
from std_msgs.msg import Header
from uav_msgs.msg import Obstacle

from perception_core import NS, Ahead, FaultKind, Finding, broken, first_trouble
from perception_core.images import GrayConverter
from perception_core.ros import (
    DoneReporter,
    EnableSwitch,
    HealthReporter,
    NewestWorker,
    RawSubscriber,
    TunableSettings,
    Vehicle,
    cloud_message,
    depth_message,
    obstacle_message,
    read_settings,
)
from zed_depth.ahead import look_ahead
from zed_depth.pairing import Pairing, StereoPair
from zed_depth.rig import Depth, StereoRig
from zed_depth.settings import ZedSettings
from zed_depth.stereo import points_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

IMAGE_BYTES = 1 << 22
INFO_BYTES = 1 << 16
SIDES = ("left", "right")


class ZedDepthNode:
    """Convert in, call the core, publish out."""

    def __init__(self, settings: ZedSettings) -> None:
        self._settings = settings
        self._gray = GrayConverter()  # of both: cameras of 10 or 12 bits must be taken for the same kind
        self._infos: dict[str, CameraInfo] = {}
        self._pairing = Pairing(tolerance_s=settings.sync_tolerance_s)
        self._vehicle = Vehicle()
        self._rig = StereoRig(settings, self._camera_pose)
        self._lock = Lock()
        self._frame = ""
        self._depth = rospy.Publisher("~depth", Image, queue_size=1)
        self._confidence = rospy.Publisher("~confidence", Image, queue_size=1)
        self._points = rospy.Publisher("~points", PointCloud2, queue_size=1)
        self._obstacle = rospy.Publisher("~obstacle", Obstacle, queue_size=1, tcp_nodelay=True)
        self._done = DoneReporter()
        self._health = HealthReporter("zed", resource="zed_status", limits=settings.health, stamps=settings.stamps)
        self._worker = NewestWorker[StereoPair](self._process)
        self._switch = EnableSwitch(enabled=settings.enabled, on_change=lambda _enabled: self._rig.rest())
        self._tuning = TunableSettings(settings, self._tune)
        self._inputs: dict[str, RawSubscriber[CameraInfo] | RawSubscriber[Image]] = {}
        for side in SIDES:
            self._subscribe(side)
        self._health.missing = self._missing

    def _subscribe(self, side: str) -> None:
        garbage, info, image = self._garbage_of(side), f"/zed/{side}/camera_info", f"/zed/{side}/image_raw"
        self._inputs[f"camera_info on {info}"] = RawSubscriber(
            info, CameraInfo, lambda m: self._on_info(m, side), garbage, buffer_bytes=INFO_BYTES
        )
        self._inputs[f"images on {image}"] = RawSubscriber(
            image, Image, lambda m: self._on_image(m, side), garbage, buffer_bytes=IMAGE_BYTES
        )

    def _missing(self) -> str:
        absent = [f"no {what}" for what, subscriber in self._inputs.items() if not subscriber.published]
        return f"{', '.join(absent)}: no driver publishes there" if absent else ""

    def _garbage_of(self, side: str) -> Callable[[str], None]:
        return lambda reason: self._trouble(broken(FaultKind.FORMAT, f"{side}: {reason}"), rospy.Time.now().to_nsec())

    def _tune(self, settings: ZedSettings) -> None:
        self._health.tune(settings.health, settings.stamps)
        with self._lock:
            self._settings, self._rig = settings, StereoRig(settings, self._camera_pose)
            self._pairing = Pairing(tolerance_s=settings.sync_tolerance_s)
            for side, info in self._infos.items():
                self._rig.take_info(side, info)

    def _on_info(self, message: CameraInfo, side: str) -> None:
        with self._lock:
            self._infos[side] = message
            self._rig.take_info(side, message)

    def _on_image(self, message: Image, side: str) -> None:
        stamp_ns = message.header.stamp.to_nsec()
        try:
            with self._lock:
                image = self._gray.gray(message)
        except ValueError as error:
            self._trouble(broken(FaultKind.FORMAT, f"{side} image: {error}"), stamp_ns)
            self._done.done(stamp_ns)
            return
        with self._lock:
            self._frame = message.header.frame_id if side == "left" else self._frame
            pair = self._pairing.add(side, stamp_ns, image)
            apart_s = self._pairing.apart_s()
            finding = self._judged(pair) if pair is not None else None
        if pair is None or finding is None:
            if apart_s > self._settings.sync_tolerance_s:
                self._trouble(broken(FaultKind.STAMP, f"left and right images are {apart_s:.2f} s apart"), stamp_ns)
        elif not finding.ok:
            self._trouble(finding, pair.stamp_ns)
            self._done.done(pair.stamp_ns)
        else:
            self._health.take(finding)
            if self._switch.enabled:
                self._worker.offer(pair)
            else:
                self._done.done(pair.stamp_ns)

    def _camera_pose(self, stamp_ns: int) -> NDArray[np.float64] | None:
        try:
            return self._vehicle.poses.at([stamp_ns]).matrix() @ self._vehicle.mount(self._frame)
        except LookupError:
            return None

    def _judged(self, pair: StereoPair) -> Finding:
        stamp = self._health.stamp(pair.stamp_ns)
        return first_trouble(stamp, self._rig.finding(pair))

    def _trouble(self, finding: Finding, stamp_ns: int) -> None:
        self._health.take(finding)
        self._tell(stamp_ns, Ahead(None, finding.reason))

    def _process(self, pair: StereoPair) -> None:
        try:
            depth = self._rig.depth(pair)
            self._publish_depth(depth, pair.stamp_ns)
            ahead = look_ahead(
                depth.metres,
                pair.stamp_ns,
                geometry=depth.geometry,
                T_base_camera=self._vehicle.mount(self._frame),
                poses=self._vehicle.poses_at(pair.stamp_ns),
                motion=self._vehicle.motion,
                settings=self._settings.ahead,
            )
            self._tell(pair.stamp_ns, replace(ahead, unknown=ahead.unknown or depth.doubt))
        except (LookupError, ValueError) as error:
            self._tell(pair.stamp_ns, Ahead(None, str(error)))
            raise
        finally:
            self._done.done(pair.stamp_ns)

    def _publish_depth(self, depth: Depth, stamp_ns: int) -> None:
        header = Header(stamp=rospy.Time(stamp_ns // NS, stamp_ns % NS), frame_id=self._frame)
        if self._depth.get_num_connections():
            self._depth.publish(depth_message(header, depth.metres))
        if self._confidence.get_num_connections():
            self._confidence.publish(depth_message(header, depth.confidence()))
        if self._points.get_num_connections():
            stride = self._settings.stride_px
            wanted = depth.metres[::stride, ::stride] <= self._settings.max_range_m
            points, _ = points_of(depth.metres, depth.geometry, wanted, stride_px=stride)
            confidence = depth.confidence()[::stride, ::stride][wanted]
            self._points.publish(cloud_message(header, points.astype(np.float32), confidence))

    def _tell(self, stamp_ns: int, ahead: Ahead) -> None:
        if self._switch.enabled:
            unknown = ahead.unknown if self._health.ok else ahead.unknown or f"the camera is not believed: {self._health.reason}"
            self._obstacle.publish(obstacle_message(stamp_ns, "zed", ahead.nearest, unknown))


def main() -> None:
    """Run the node until ROS shuts down."""
    rospy.init_node("zed_depth")
    settings = read_settings(ZedSettings())
    cv2.setNumThreads(settings.threads)
    _node = ZedDepthNode(settings)
    rospy.spin()
