"""What /zed_depth does with its messages: health always; depth image, points and obstacle while enabled. No rospy."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from threading import Lock
from typing import TYPE_CHECKING

import numpy as np
from genpy import Time
from sensor_msgs.msg import CameraInfo, Image, PointCloud2
from std_msgs.msg import Header
from uav_msgs.msg import Obstacle

from node_core.core import Input, Output
from perception_core import NS, Ahead, FaultKind, Finding, broken, first_trouble
from perception_core.conversions import cloud_message, depth_message, obstacle_message
from perception_core.images import GrayConverter
from perception_core.sensor_watch import HEALTH, TICK_S, SensorWatch
from perception_core.vehicle import KnownVehicle
from zed_depth.ahead import look_ahead
from zed_depth.pairing import Pairing, StereoPair
from zed_depth.rig import Depth, StereoRig
from zed_depth.stereo import points_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from node_core.core import Host
    from zed_depth.settings import ZedSettings

APART = "the cameras are not triggered together", "images of one side are lost"
IMAGE_BYTES = 1 << 22
INFO_BYTES = 1 << 16
SIDES = ("left", "right")
DEPTH, CONFIDENCE, POINTS = Output("~depth", Image), Output("~confidence", Image), Output("~points", PointCloud2)
OBSTACLE = Output("~obstacle", Obstacle, tcp_nodelay=True, taken="/uav_guidance/taken")
OUTPUTS = (DEPTH, CONFIDENCE, POINTS, OBSTACLE, HEALTH)


class ZedDepth:
    """Judges each pair; while enabled it looks for what is in the way, on the host's worker."""

    def __init__(self, settings: ZedSettings, host: Host) -> None:
        self.enabled = settings.enabled
        self.vehicle = KnownVehicle()
        self.frame = ""  # the left camera's
        self._settings = settings
        self._host = host
        self._gray = GrayConverter()  # of both: cameras of 10 or 12 bits must be taken for the same kind
        self._infos: dict[str, CameraInfo] = {}
        self._pairing = Pairing(tolerance_s=settings.sync_tolerance_s)
        self._rig = StereoRig(settings, self._camera_pose)
        self._lock = Lock()
        self._health = SensorWatch(host, "zed", resource="perception.zed_status", limits=settings.health, stamps=settings.stamps)
        self._images = [each for side in SIDES for each in self._inputs_of(side)]

    @property
    def inputs(self) -> list[Input]:
        """The guidance's topics, and the images and calibrations of both cameras."""
        return [*self.vehicle.inputs(self._left_out), *self._images]

    def _inputs_of(self, side: str) -> list[Input]:
        garbage = self._garbage_of(side)
        return [
            Input(f"/zed/{side}/camera_info", CameraInfo, partial(self.take_info, side), garbage, INFO_BYTES),
            Input(f"/zed/{side}/image_raw", Image, partial(self._on_image, side), garbage, IMAGE_BYTES),
        ]

    @property
    def timers(self) -> list[tuple[float, Callable[[], None]]]:
        """The judgement of the camera's health."""
        return [(TICK_S, lambda: self._health.tick(self._missing()))]

    def switch(self, enabled: bool) -> None:  # noqa: FBT001 -- a callback's signature
        """Begin or end to look for obstacles."""
        self.enabled = enabled
        self._rig.rest()

    def _missing(self) -> str:
        named = {"camera_info": "camera_info", "image_raw": "images"}
        absent = [
            f"no {named[each.topic.rpartition('/')[2]]} on {each.topic}" for each in self._images if not self._host.published(each.topic)
        ]
        return f"{', '.join(absent)}: no driver publishes there" if absent else ""

    def _left_out(self, reason: str) -> None:
        self._host.warn("garbage", f"left out: {reason}")

    def _garbage_of(self, side: str) -> Callable[[str], None]:
        return lambda reason: self._trouble(broken(FaultKind.FORMAT, f"{side}: {reason}"), self._host.now_ns())

    def tune(self, settings: ZedSettings) -> None:
        """Go on with other settings."""
        self._health.tune(settings.health, settings.stamps)
        with self._lock:
            self._settings, self._rig = settings, StereoRig(settings, self._camera_pose)
            self._pairing = Pairing(tolerance_s=settings.sync_tolerance_s)
            for side, info in self._infos.items():
                self._rig.take_info(side, info)

    def take_info(self, side: str, message: CameraInfo) -> None:
        """Take the calibration of the side ``left`` or ``right``."""
        with self._lock:
            self._infos[side] = message
            self._rig.take_info(side, message)

    def _on_image(self, side: str, message: Image) -> None:
        stamp_ns = message.header.stamp.to_nsec()
        try:
            with self._lock:
                image = self._gray.gray(message)
        except ValueError as error:
            self._trouble(broken(FaultKind.FORMAT, f"{side} image: {error}"), stamp_ns)
            self._host.done(stamp_ns)
            return
        with self._lock:
            self.frame = message.header.frame_id if side == "left" else self.frame
            pair = self._pairing.add(side, stamp_ns, image)
            apart_s = self._pairing.apart_s()
            finding = self.finding(pair) if pair is not None else None
        if pair is None or finding is None:
            if apart_s > self._settings.sync_tolerance_s:
                self._trouble(broken(FaultKind.STAMP, f"left and right images are {apart_s:.2f} s apart", *APART), stamp_ns)
        elif not finding.ok:
            self._trouble(finding, pair.stamp_ns)
            self._host.done(pair.stamp_ns)
        else:
            self._health.take(finding)
            if self.enabled:
                self._host.offer(partial(self._process, pair))
            else:
                self._host.done(pair.stamp_ns)

    def _camera_pose(self, stamp_ns: int) -> NDArray[np.float64] | None:
        try:
            return self.vehicle.poses.at([stamp_ns]).matrix() @ self.vehicle.mount(self.frame)
        except LookupError:
            return None

    def finding(self, pair: StereoPair) -> Finding:
        """Return the finding about a pair that has just arrived; call it once for each, in order."""
        stamp = self._health.stamp(pair.stamp_ns)
        return first_trouble(stamp, self._rig.finding(pair))

    def _trouble(self, finding: Finding, stamp_ns: int) -> None:
        self._health.take(finding)
        self._tell(stamp_ns, Ahead(None, finding.reason))

    def _process(self, pair: StereoPair) -> None:
        try:
            depth = self.depth(pair)
            self._publish_depth(depth, pair.stamp_ns)
            self._tell(pair.stamp_ns, self.ahead(depth, pair.stamp_ns))
        except (LookupError, ValueError) as error:
            self._tell(pair.stamp_ns, Ahead(None, str(error)))
            raise
        finally:
            self._host.done(pair.stamp_ns)

    def depth(self, pair: StereoPair) -> Depth:
        """Return the depth of a good pair; raise CalibrationError."""
        return self._rig.depth(pair)

    def ahead(self, depth: Depth, stamp_ns: int) -> Ahead:
        """Return what a depth shows ahead of the vehicle; raise LookupError where its pose or the camera's mount is not known."""
        ahead = look_ahead(
            depth.metres,
            stamp_ns,
            geometry=depth.geometry,
            T_base_camera=self.vehicle.mount(self.frame),
            poses=self.vehicle.poses_at(stamp_ns),
            motion=self.vehicle.motion,
            settings=self._settings.ahead,
        )
        return replace(ahead, unknown=ahead.unknown or depth.doubt)

    def _publish_depth(self, depth: Depth, stamp_ns: int) -> None:
        header = Header(stamp=Time(stamp_ns // NS, stamp_ns % NS), frame_id=self.frame)
        if self._host.wanted(DEPTH.topic):
            self._host.publish(DEPTH.topic, depth_message(header, depth.metres))
        if self._host.wanted(CONFIDENCE.topic):
            self._host.publish(CONFIDENCE.topic, depth_message(header, depth.confidence()))
        if self._host.wanted(POINTS.topic):
            stride = self._settings.stride_px
            wanted = depth.metres[::stride, ::stride] <= self._settings.max_range_m
            points, _ = points_of(depth.metres, depth.geometry, wanted, stride_px=stride)
            confidence = depth.confidence()[::stride, ::stride][wanted]
            self._host.publish(POINTS.topic, cloud_message(header, points.astype(np.float32), confidence))

    def _tell(self, stamp_ns: int, ahead: Ahead) -> None:
        if self.enabled:
            unknown = ahead.unknown if self._health.ok else ahead.unknown or f"the camera is not believed: {self._health.reason}"
            self._host.publish(OBSTACLE.topic, obstacle_message(stamp_ns, "zed", ahead.nearest, unknown))
