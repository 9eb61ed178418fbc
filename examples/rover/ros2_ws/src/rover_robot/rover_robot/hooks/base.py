"""The hooks of the skillset `base`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from base_managers.hooks import (
    AbstractCreepSkill,
    AbstractDockSkill,
    AbstractDriveToSkill,
    AbstractFollowCorridorSkill,
    AbstractLocaliseSkill,
    AbstractStopHereSkill,
)
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from skillset_ros2 import Watch

from rover_robot.hooks.journey import Journey, ends

if TYPE_CHECKING:
    from alula import Execution, SkillHooks
    from rclpy.node import Node

STANDS_M_S, STANDS_RAD_S = 0.01, 0.02


class DriveTo(Journey, AbstractDriveToSkill):
    """By the navigation's plan."""

    server = "move_base"


class FollowCorridor(Journey, AbstractFollowCorridorSkill):
    """Between two walls."""

    server = "follow_corridor"


class Creep(Journey, AbstractCreepSkill):
    """Without the laser."""

    server = "creep"


class Dock(Journey, AbstractDockSkill):
    """Into the dock."""

    server, results = "dock", ends("DOCKED")


class Localise(Journey, AbstractLocaliseSkill):
    """Where it is: the localisation turns the rover."""

    server, results, lost = "localize", ends("FOUND", "LOST"), "LOST"


class StopHere(AbstractStopHereSkill):
    """Commands no speed until the wheels stand."""

    def __init__(self, node: Node, watch: Watch) -> None:
        self._watch = watch
        self._execution: Execution | None = None
        self._commands = node.create_publisher(Twist, "cmd_vel", 5)
        node.create_subscription(Odometry, "odom", self._on_odometry, 5)
        watch.every(self._command, lambda: self._execution is not None)

    def on_dispatch(self, execution: Execution) -> None:
        """Begin."""
        self._execution = execution
        self._watch.wake()
        self._command()

    def on_interrupt(self, execution: Execution) -> None:
        """Command nothing any more."""
        if execution is self._execution:
            self._execution = None

    def _command(self) -> None:
        if self._execution is not None:
            self._commands.publish(Twist())

    def _on_odometry(self, message: Odometry) -> None:
        speed, execution = message.twist.twist, self._execution
        if execution is not None and abs(speed.linear.x) < STANDS_M_S and abs(speed.angular.z) < STANDS_RAD_S:
            self._execution = None
            self.terminated_STANDING(execution)


def make_hooks(node: Node) -> dict[str, SkillHooks]:
    """Make the hooks of all skills."""
    watch = Watch(node)
    return {
        "drive_to": DriveTo(watch),
        "follow_corridor": FollowCorridor(watch),
        "creep": Creep(watch),
        "dock": Dock(watch),
        "localise": Localise(watch),
        "stop_here": StopHere(node, watch),
    }
