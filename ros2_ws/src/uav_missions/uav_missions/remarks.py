"""What the functional layer says of the drone's resources: why a sensor is not believed, and what took the authority."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rclpy.node import Node
    from uav_msgs.msg import GuidanceState, SensorHealth

    from skill_missions.blackboard import Blackboard

SENSORS = {"perception.zed_status": "/zed_depth/health", "perception.lidar_status": "/lidar_obstacles/health"}
AUTHORITY = "navigation.SDK_authority"
AUTHORITY_INVARIANT = "keep_sdk_authority"
DEPTH = 5
ON_GROUND = 1  # GuidanceState.ON_GROUND


def listen(node: Node, blackboard: Blackboard) -> None:
    """Have the mission's node keep the blackboard's remarks up to date."""
    from uav_msgs.msg import GuidanceState, SensorHealth  # missions over mocks have no ROS

    for resource, topic in SENSORS.items():
        node.create_subscription(SensorHealth, topic, partial(note_health, blackboard, resource), DEPTH)
    node.create_subscription(GuidanceState, "/uav_guidance/state", partial(note_authority, blackboard), DEPTH)


def note_health(blackboard: Blackboard, resource: str, health: SensorHealth | Any) -> None:
    """Remark what is wrong with a sensor."""
    blackboard.remarks[resource] = str(health.reason)


def note_authority(blackboard: Blackboard, state: GuidanceState | Any) -> None:
    """Remark why the companion does not command: no link is another matter than a pilot. What was remarked in flight stays."""
    if state.authority:
        remark = "" if state.landed_state == ON_GROUND else blackboard.remarks.get(AUTHORITY, "")
    elif not state.link:
        remark = "the link to the autopilot is lost"
    elif state.landed_state == ON_GROUND and not state.ready:
        remark = f"the vehicle stands in {state.mode}, its own checks are not passed"
    else:
        remark = f"the vehicle is in {state.mode}: the pilot or a failsafe has it"
    blackboard.remarks[AUTHORITY] = remark


def holder_of_the_vehicle(blackboard: Blackboard) -> str:
    """Return what has a vehicle whose authority was lost; empty where the guidance was not listened to."""
    # The guidance takes it from the skills and keeps it in one case only.
    return (blackboard.remarks[AUTHORITY] or "the autopilot has restarted") if AUTHORITY in blackboard.remarks else ""
