"""The sensors' drivers on ROS: measure when it is time and somebody listens, publish as the sensor's mode says."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np
import rospy
from numpy.typing import NDArray
from sensor_msgs.msg import CameraInfo, Image, Imu, PointCloud2

from uav_simulator import ros_messages
from uav_simulator.sensors.faults import SensorMode
from uav_simulator.sensors.imu import ImuReading
from uav_simulator.sensors.lidar import POINT_DTYPE
from uav_simulator.simulation import TICK_NS, Simulation

ZERO = (0.0, 0.0, 0.0)
Pixels = NDArray[np.uint8]


class Driver(Protocol):
    """One sensor's driver."""

    sensor: str
    every_ticks: int
    at_tick: int  # within its period: sensors take turns, so that the work spreads

    def publish(self, mode: SensorMode) -> int | None:
        """Publish one measurement of this moment and return its stamp (ns); None when nobody listens."""


class _Publisher:
    """A publisher that knows whether somebody listens."""

    def __init__(self, topic: str, kind: type) -> None:
        self._publisher = rospy.Publisher(topic, kind, queue_size=5)
        self.publish: Callable[[object], None] = self._publisher.publish

    @property
    def wanted(self) -> bool:
        """Return whether there is a subscriber."""
        return bool(self._publisher.get_num_connections() > 0)


class ZedDriver:
    """Both images and their infos, 10 Hz."""

    sensor, every_ticks, at_tick = "zed", 5, 0

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        self._images = [_Publisher(f"/zed/{eye}/image_raw", Image) for eye in ("left", "right")]
        self._infos = [_Publisher(f"/zed/{eye}/camera_info", CameraInfo) for eye in ("left", "right")]
        camera = simulation.stereo.camera
        black: Pixels = np.zeros((camera.height, camera.width), dtype=np.uint8)
        self._black: tuple[Pixels, Pixels] = (black, black)
        self._last = self._black

    def publish(self, mode: SensorMode) -> int | None:
        """Publish images of the same stamp."""
        simulation = self._simulation
        stamp_ns = simulation.now_ns
        for info, right in zip(self._infos, (False, True), strict=True):
            info.publish(ros_messages.camera_info(simulation.stereo.camera, right=right, stamp_ns=stamp_ns))
        if not any(p.wanted for p in self._images):
            return None
        if mode is SensorMode.OK:
            self._last = simulation.stereo.render(simulation.pose)
        images = self._black if mode is SensorMode.BLACK else self._last
        for publisher, pixels in zip(self._images, images, strict=True):
            publisher.publish(ros_messages.image(pixels, stamp_ns))
        return stamp_ns


class LidarDriver:
    """The sweep that ends at this moment, 10 Hz."""

    sensor, every_ticks, at_tick = "lidar", 5, 2

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        self._cloud = _Publisher("/lidar/points", PointCloud2)
        self._last: NDArray[np.void] = np.empty(0, dtype=POINT_DTYPE)

    def publish(self, mode: SensorMode) -> int | None:
        """Publish a cloud stamped with the sweep's beginning."""
        if not self._cloud.wanted:
            return None
        start_ns = self._simulation.now_ns - self.every_ticks * TICK_NS
        if start_ns < 0:
            return None
        if mode is SensorMode.OK:
            self._last = self._simulation.lidar.scan(self._simulation.track, start_ns * 1e-9)
        points = np.empty(0, dtype=POINT_DTYPE) if mode is SensorMode.BLACK else self._last
        self._cloud.publish(ros_messages.cloud(points, start_ns))
        return start_ns


class ImuDriver:
    """One reading each tick, 50 Hz."""

    sensor, every_ticks, at_tick = "imu", 1, 0

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        self._imu = _Publisher("/imu/data", Imu)
        self._last = ImuReading(ZERO, ZERO)

    def publish(self, mode: SensorMode) -> int | None:
        """Publish one reading."""
        if not self._imu.wanted:
            return None
        if mode is SensorMode.OK:
            body = self._simulation.vehicle.body
            self._last = self._simulation.imu.measure(body.rates, body.specific_force)
        reading = ImuReading(ZERO, ZERO) if mode is SensorMode.BLACK else self._last
        self._imu.publish(ros_messages.imu(reading, self._simulation.now_ns))
        return self._simulation.now_ns


class Drivers:
    """All drivers, each at its time."""

    def __init__(self, simulation: Simulation, measured: Callable[[str, float], None]) -> None:
        """``measured`` is told the sensor and the stamp (seconds) of what was published."""
        self._simulation = simulation
        self._measured = measured
        self._drivers: list[Driver] = [ZedDriver(simulation), LidarDriver(simulation), ImuDriver(simulation)]

    def publish_due(self) -> None:
        """Let the drivers publish whose time has come."""
        tick = self._simulation.now_ns // TICK_NS
        for driver in self._drivers:
            mode = self._simulation.sensors.mode(driver.sensor)
            if tick % driver.every_ticks == driver.at_tick and mode is not SensorMode.DEAD:
                stamp_ns = driver.publish(mode)
                if stamp_ns is not None:
                    self._measured(driver.sensor, stamp_ns * 1e-9)
