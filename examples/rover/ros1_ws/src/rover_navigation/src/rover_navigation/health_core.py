"""Health's core: watches what is measured, and reports the resources of the skillsets that only the functional layer knows.

Tells all verdicts on /health (std_msgs/String of JSON), so that a record says why a resource changed.
"""

from __future__ import annotations

import json

import numpy as np
from geometry_msgs.msg import PoseWithCovarianceStamped, Twist
from nav_msgs.msg import Odometry
from node_core import Host, Input, Output
from sensor_msgs.msg import BatteryState, LaserScan
from std_msgs.msg import Bool, Float32, Header, String

from rover_navigation.health import OK, BumperMonitor, LaserMonitor, PoseMonitor, WheelMonitor, WheelReading
from rover_navigation.ros import pose_of

COMMAND_TIMEOUT_S = 0.5  # the base stops by itself when no command comes any more

NAME = "health"
VERDICTS = Output("/health", String, queue_size=5, latch=True)
SCANS = Output("~scans", Header, queue_size=20, tcp_nodelay=True)  # up to which scan it has come: a simulator may wait for it
OUTPUTS = (VERDICTS, SCANS)
SKILLSETS = ("base", "perception", "power")


class Health:
    """Reports base_status, pose_status and authority of `base`, laser and bumper_status of `perception`, charger of `power`."""

    timers = ()

    def __init__(self, host: Host) -> None:
        self._host = host
        self._laser, self._pose, self._wheels, self._bumper = LaserMonitor(), PoseMonitor(), WheelMonitor(), BumperMonitor()
        self._pressed = self._operator = False
        self._charging: bool | None = None
        self._matched: tuple[float, float] | None = None
        self._told = (0.0, -np.inf)  # rad/s, when
        self._verdicts: dict[str, str] = {}

    @property
    def inputs(self) -> list[Input]:
        """Measurements, the localisation's words, and commands; somebody who drives by hand says so by a stick's dead-man switch."""
        handlers = (
            ("/scan", LaserScan, self._on_scan),
            ("/bumper", Bool, self._on_bumper),
            ("/battery_state", BatteryState, self._on_battery),
            ("/localization/quality", Float32, lambda message: self._pose.quality(message.data)),
            ("/localization/pose", PoseWithCovarianceStamped, self._on_pose),
            ("/cmd_vel", Twist, self._on_command),
            ("/operator/drives", Bool, self._on_operator),
            ("/odom", Odometry, self._on_odometry),
        )
        return [Input(topic, kind, handler, queue_size=20) for topic, kind, handler in handlers]

    def _on_scan(self, scan: LaserScan) -> None:
        self._laser.scan(np.asarray(scan.ranges, dtype=np.float64), scan.header.stamp.to_sec())
        self._host.publish(SCANS.topic, Header(stamp=scan.header.stamp))

    def _on_bumper(self, message: Bool) -> None:
        self._pressed = message.data

    def _on_battery(self, message: BatteryState) -> None:
        self._charging = message.power_supply_status == BatteryState.POWER_SUPPLY_STATUS_CHARGING

    def _on_pose(self, message: PoseWithCovarianceStamped) -> None:
        self._matched = pose_of(message.pose.pose)[:2]

    def _on_command(self, twist: Twist) -> None:
        self._told = (twist.angular.z, self._host.now_ns() * 1e-9)

    def _on_operator(self, message: Bool) -> None:
        self._operator = message.data

    def _on_odometry(self, message: Odometry) -> None:
        """Judge, and report."""
        now_s, pose = message.header.stamp.to_sec(), pose_of(message.pose.pose)
        told_rad_s = self._told[0] if now_s - self._told[1] < COMMAND_TIMEOUT_S else 0.0
        if self._matched is not None and self._laser.verdict(now_s) == OK:  # old scans say that it stands
            self._wheels.step(WheelReading(now_s, pose[:2], self._matched, told_rad_s, message.twist.twist.angular.z))
        self._bumper.step(pose[:2], pressed=self._pressed)
        self._report(now_s)
        self._host.done(message.header.stamp.to_nsec())

    def _report(self, now_s: float) -> None:
        laser, report = self._laser.verdict(now_s), self._host.report
        report("base.authority", "OPERATOR" if self._operator else "MISSION")
        report("perception.bumper_status", self._bumper.verdict)
        if laser:
            report("perception.laser", OK if laser == OK else "BROKEN")
        if self._pose.verdict:
            report("base.pose_status", self._pose.verdict)
        if self._charging is not None:
            report("base.base_status", "DOCKED" if self._charging else "AWAY")
            report("power.charger", "ON" if self._charging else "OFF")
        verdicts = {"laser": laser, "pose": self._pose.verdict, "wheels": self._wheels.verdict, "bumper": self._bumper.verdict}
        if verdicts != self._verdicts:
            self._verdicts = verdicts
            self._host.publish(VERDICTS.topic, String(json.dumps({"t_s": round(now_s, 3), **verdicts})))
