"""The guidance's commands and setpoints as MAVLink messages."""

from __future__ import annotations

from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from uav_guidance.commands import Command
from uav_guidance.follower import Setpoint
from uav_guidance.frames import FOLLOW_POSITION_AND_YAW, ned_from_enu, yaw_ned_from_enu

AUTOPILOT_SYSTEM, AUTOPILOT_COMPONENT = 1, 1
COMPANION_SYSTEM, COMPANION_COMPONENT = 1, 191


def heartbeat_message() -> Any:
    """Return a heartbeat of the companion computer."""
    return mavlink.MAVLink_heartbeat_message(
        mavlink.MAV_TYPE_ONBOARD_CONTROLLER, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, mavlink.MAV_STATE_ACTIVE, 3
    )


def command_message(command: Command) -> Any:
    """Return a command as the MAVLink message COMMAND_LONG to the autopilot."""
    return mavlink.MAVLink_command_long_message(
        AUTOPILOT_SYSTEM, AUTOPILOT_COMPONENT, command.number, command.confirmation, *command.parameters
    )


def setpoint_message(setpoint: Setpoint) -> Any:
    """Return a SET_POSITION_TARGET_LOCAL_NED: position and yaw, relative to the EKF origin."""
    ned = ned_from_enu(setpoint.position_enu_m)
    return mavlink.MAVLink_set_position_target_local_ned_message(
        0,
        AUTOPILOT_SYSTEM,
        AUTOPILOT_COMPONENT,
        mavlink.MAV_FRAME_LOCAL_NED,
        FOLLOW_POSITION_AND_YAW,
        *(ned.x, ned.y, ned.z),
        *(0.0, 0.0, 0.0),
        *(0.0, 0.0, 0.0),
        yaw_ned_from_enu(setpoint.yaw_rad),
        0.0,
    )


def interval_message(message_id: int, rate_hz: float) -> Any:
    """Return the request for a message at a rate."""
    parameters = (float(message_id), 1e6 / rate_hz, 0.0, 0.0, 0.0, 0.0, 0.0)
    return command_message(Command("message interval", mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, parameters))


def from_autopilot_to_us(message: Any) -> bool:
    """Return whether a message is the autopilot's own and for us, neither forwarded nor an answer to another client."""
    if (message.get_srcSystem(), message.get_srcComponent()) != (AUTOPILOT_SYSTEM, AUTOPILOT_COMPONENT):
        return False
    if message.get_type() != "COMMAND_ACK":
        return True
    return message.target_system in {0, COMPANION_SYSTEM} and message.target_component in {0, COMPANION_COMPONENT}
