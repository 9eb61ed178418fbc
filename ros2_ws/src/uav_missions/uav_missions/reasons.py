"""What the functional layer says of the drone's resources: why a sensor is not believed, and what took the authority."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rclpy.node import Node
    from uav_msgs.msg import GuidanceState, SensorHealth

    from alula.missions.blackboard import Blackboard

SENSORS = {"perception.zed_status": "/zed_depth/health", "perception.lidar_status": "/lidar_obstacles/health"}
AUTHORITY = "navigation.SDK_authority"
AUTHORITY_INVARIANT = "keep_sdk_authority"
DEPTH = 5
ON_GROUND = 1  # GuidanceState.ON_GROUND
RESTARTED = "the autopilot has restarted"


def listen(node: Node, blackboard: Blackboard) -> None:
    """Have the mission's node keep the blackboard's reasons up to date."""
    from uav_msgs.msg import GuidanceState, SensorHealth  # missions over mocks have no ROS

    for resource, topic in SENSORS.items():
        node.create_subscription(SensorHealth, topic, partial(note_health, blackboard, resource), DEPTH)
    node.create_subscription(GuidanceState, "/uav_guidance/state", AuthorityReasons(blackboard).note, DEPTH)


def note_health(blackboard: Blackboard, resource: str, health: SensorHealth | Any) -> None:
    """Note what is wrong with a sensor."""
    blackboard.reasons[resource] = str(health.reason)


class AuthorityReasons:
    """Notes why the companion does not command: the link is lost, a pilot or a failsafe commands, or the autopilot has restarted."""

    def __init__(self, blackboard: Blackboard) -> None:
        self._reasons = blackboard.reasons
        self._flying = self._flown = False

    def note(self, state: GuidanceState | Any) -> None:
        """Take a state of the guidance. What was noted in flight stays, also when the vehicle is given back and has landed."""
        standing = state.landed_state == ON_GROUND
        self._flown |= not standing
        if state.authority:
            reason = self._reasons.get(AUTHORITY, "") if self._flown else ""
        elif not state.link:
            reason = "the link to the autopilot is lost"
        elif standing and not state.ready:
            # One that restarts in the air says that it stands, before it has looked.
            reason = RESTARTED if self._flying else f"the vehicle stands in {state.mode}, its own checks are not passed"
        else:
            reason = f"the vehicle is in {state.mode}: the pilot or a failsafe has it"
        if state.link and (state.ready or not standing):
            self._flying = not standing
        self._reasons[AUTHORITY] = reason


def holder_of_the_vehicle(blackboard: Blackboard) -> str:
    """Return what has a vehicle whose authority was lost; empty where the guidance was not listened to."""
    # The guidance takes it from the skills and keeps it in one case only.
    return (blackboard.reasons[AUTHORITY] or RESTARTED) if AUTHORITY in blackboard.reasons else ""
