"""The sensors' drivers on ROS: measure when a measurement is due and has subscribers, publish by the sensor's mode."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import rospy
from numpy.typing import NDArray
from sensor_msgs.msg import CameraInfo, Image, Imu, PointCloud2

from uav_simulator import ros_messages
from uav_simulator.sensors import degradation
from uav_simulator.sensors.camera import ColourCamera
from uav_simulator.sensors.faults import SensorMode
from uav_simulator.sensors.imu import ImuReading
from uav_simulator.simulation import TICK_NS, Simulation

HELD = (SensorMode.FROZEN, SensorMode.FLICKERING)  # no new measurement
Rng = np.random.Generator


@dataclass(frozen=True)
class Measurement:
    """What a driver sends: the moment that it measured, and the call that publishes the messages."""

    taken_ns: int
    publish: Callable[[], None]


class Driver(Protocol):
    """Measures with one sensor, and publishes what it measured."""

    sensor: str
    every_ticks: int
    quick: bool  # costs next to nothing
    at_ticks: tuple[int, ...]  # within its period: sensors take turns, so that the work spreads

    def measure(self, mode: SensorMode, stamp_shift_ns: int) -> Measurement | None:
        """Measure this moment as the mode has it, with a stamp that is wrong by so much; None without subscribers."""


class _Publisher:
    """A publisher that knows whether it has subscribers."""

    def __init__(self, topic: str, kind: type) -> None:
        self._publisher = rospy.Publisher(topic, kind, queue_size=5)
        self.publish: Callable[[object], None] = self._publisher.publish

    @property
    def wanted(self) -> bool:
        """Return whether there is a subscriber."""
        return bool(self._publisher.get_num_connections() > 0)


class ZedDriver:
    """Both images and their infos, 10 Hz."""

    sensor, every_ticks, quick = "zed", 5, False
    at_ticks: tuple[int, ...] = (0,)

    def __init__(self, simulation: Simulation, rng: Rng) -> None:
        self._simulation, self._rng = simulation, rng
        self._publishers = [
            *(_Publisher(f"/zed/{eye}/camera_info", CameraInfo) for eye in ("left", "right")),
            *(_Publisher(f"/zed/{eye}/image_raw", Image) for eye in ("left", "right")),
        ]
        self._last: degradation.Pair | None = None

    def measure(self, mode: SensorMode, stamp_shift_ns: int) -> Measurement | None:
        """Take both images at once."""
        simulation = self._simulation
        if not any(publisher.wanted for publisher in self._publishers):
            return None
        stamp_ns = simulation.now_ns + stamp_shift_ns
        if self._last is None or mode not in HELD:
            self._last = simulation.stereo.render(simulation.pose)
        camera = simulation.stereo.camera
        if mode is SensorMode.WRONG_INFO:
            camera = camera.scaled(2)
        messages = [
            *(ros_messages.camera_info(camera, right=right, stamp_ns=stamp_ns) for right in (False, True)),
            *(ros_messages.image(pixels, stamp_ns) for pixels in degradation.pair(mode, self._last, self._rng)),
        ]
        return Measurement(simulation.now_ns, lambda: self._send(messages))

    def _send(self, messages: list[object]) -> None:
        for publisher, message in zip(self._publishers, messages, strict=True):
            publisher.publish(message)


class LidarDriver:
    """The sweep that ends at this moment, 10 Hz; its stamp is the sweep's beginning."""

    sensor, every_ticks, quick = "lidar", 5, False
    at_ticks: tuple[int, ...] = (2,)

    def __init__(self, simulation: Simulation, rng: Rng) -> None:
        self._simulation, self._rng = simulation, rng
        self._cloud = _Publisher("/lidar/points", PointCloud2)
        self._last: NDArray[np.void] | None = None

    def measure(self, mode: SensorMode, stamp_shift_ns: int) -> Measurement | None:
        """Scan the sweep that ends now; its stamp is the sweep's begin."""
        start_ns = self._simulation.now_ns - self.every_ticks * TICK_NS
        if not self._cloud.wanted or start_ns < 0:
            return None
        if self._last is None or mode not in HELD:
            self._last = self._simulation.lidar.scan(self._simulation.track, start_ns * 1e-9)
        message = ros_messages.cloud(degradation.sweep(mode, self._last, self._rng), start_ns + stamp_shift_ns)
        return Measurement(start_ns, lambda: self._cloud.publish(message))


class ImuDriver:
    """One reading each tick, 50 Hz."""

    sensor, every_ticks, quick = "imu", 1, True
    at_ticks: tuple[int, ...] = (0,)

    def __init__(self, simulation: Simulation, rng: Rng) -> None:
        self._simulation, self._rng = simulation, rng
        self._imu = _Publisher("/imu/data", Imu)
        self._last: ImuReading | None = None

    def measure(self, mode: SensorMode, stamp_shift_ns: int) -> Measurement | None:
        """Measure rates and specific force at this tick."""
        if not self._imu.wanted:
            return None
        simulation = self._simulation
        if self._last is None or mode not in HELD:
            body = simulation.flown.body
            self._last = simulation.imu.measure(body.rates, body.specific_force)
        message = ros_messages.imu(degradation.inertial(mode, self._last, self._rng), simulation.now_ns + stamp_shift_ns)
        return Measurement(simulation.now_ns, lambda: self._imu.publish(message))


class CameraDriver:
    """The inspection camera's picture in colour, 20 Hz on the grid of the ticks: 40 and 60 ms apart by turns."""

    sensor, every_ticks, quick = "camera", 5, False
    at_ticks: tuple[int, ...] = (1, 3)

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        self._image = _Publisher("/camera/image_raw", Image)
        self._camera: ColourCamera | None = None
        self._last: NDArray[np.uint8] | None = None

    def measure(self, mode: SensorMode, stamp_shift_ns: int) -> Measurement | None:
        """Render the colour image at this tick."""
        simulation = self._simulation
        if not self._image.wanted:
            return None
        if self._camera is None:  # only scenarios with a camera pay for its textures
            self._camera = ColourCamera(simulation.world, simulation.seed)
        if self._last is None or mode not in HELD:
            self._last = self._camera.render(simulation.pose)
        pixels = np.zeros_like(self._last) if mode is SensorMode.BLACK else self._last
        message = ros_messages.colour_image(pixels, simulation.now_ns + stamp_shift_ns)
        return Measurement(simulation.now_ns, lambda: self._image.publish(message))


class Drivers:
    """All drivers, each at its time; what a late sensor has measured is published when it arrives."""

    def __init__(self, simulation: Simulation, measured: Callable[[str, float, float], None]) -> None:
        """``measured`` is told the sensor, the stamp of what was published, and the present time (seconds)."""
        self._simulation = simulation
        self._measured = measured
        rngs = [np.random.default_rng([simulation.seed, 6, n]) for n in range(3)]
        self._drivers: list[Driver] = [
            ZedDriver(simulation, rngs[0]),
            LidarDriver(simulation, rngs[1]),
            ImuDriver(simulation, rngs[2]),
            CameraDriver(simulation),
        ]
        errors = simulation.imperfections
        latency_s = {"zed": errors.zed_latency_s, "lidar": errors.lidar_latency_s, "imu": errors.imu_latency_s, "camera": 0.0}
        self._latency_ns = {sensor: round(seconds * 1e9) for sensor, seconds in latency_s.items()}
        self._under_way: dict[str, deque[tuple[int, Measurement]]] = {driver.sensor: deque() for driver in self._drivers}

    def publish_due(self, *, late: bool) -> None:
        """Let the drivers measure whose time has come, and publish what has arrived; ``late``: leave out what takes long."""
        now_ns = self._simulation.now_ns
        for driver in self._drivers:
            mode = self._simulation.sensors.mode(driver.sensor)
            under_way = self._under_way[driver.sensor]
            if mode is SensorMode.DEAD:
                under_way.clear()
            elif now_ns // TICK_NS % driver.every_ticks in driver.at_ticks and (driver.quick or not late):
                measurement = driver.measure(mode, degradation.FUTURE_NS if mode is SensorMode.FUTURE else 0)
                if measurement is not None:
                    late_ns = degradation.LATE_NS if mode is SensorMode.LATE else 0
                    under_way.append((now_ns + self._latency_ns[driver.sensor] + late_ns, measurement))
            while under_way and under_way[0][0] <= now_ns:
                self._publish(driver.sensor, mode, under_way.popleft()[1])

    def _publish(self, sensor: str, mode: SensorMode, measurement: Measurement) -> None:
        measurement.publish()
        # A node that rightly refuses a stamp of the future never reports that it is done, so time does not wait for it.
        if mode is not SensorMode.FUTURE:
            self._measured(sensor, measurement.taken_ns * 1e-9, self._simulation.now_s)
