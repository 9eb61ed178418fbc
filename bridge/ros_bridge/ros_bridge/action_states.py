"""The states of a goal in both worlds, and which is which.

ROS 1: actionlib_msgs/GoalStatus and the ROS wiki's "actionlib/DetailedDescription". ROS 2: action_msgs/GoalStatus and the design article
"Actions" on design.ros2.org.
"""

from __future__ import annotations

from enum import IntEnum


class Ros1Status(IntEnum):
    """The states of actionlib_msgs/GoalStatus."""

    PENDING = 0
    ACTIVE = 1
    PREEMPTED = 2
    SUCCEEDED = 3
    ABORTED = 4
    REJECTED = 5
    PREEMPTING = 6
    RECALLING = 7
    RECALLED = 8
    LOST = 9


class Ros2Status(IntEnum):
    """The states of action_msgs/GoalStatus."""

    UNKNOWN = 0
    ACCEPTED = 1
    EXECUTING = 2
    CANCELING = 3
    SUCCEEDED = 4
    CANCELED = 5
    ABORTED = 6


class CancelCode(IntEnum):
    """The return codes of action_msgs/CancelGoal."""

    NONE = 0
    REJECTED = 1
    UNKNOWN_GOAL_ID = 2
    GOAL_TERMINATED = 3


ROS1_TERMINAL = frozenset(
    {Ros1Status.PREEMPTED, Ros1Status.SUCCEEDED, Ros1Status.ABORTED, Ros1Status.REJECTED, Ros1Status.RECALLED, Ros1Status.LOST}
)
ROS2_TERMINAL = frozenset({Ros2Status.SUCCEEDED, Ros2Status.CANCELED, Ros2Status.ABORTED})

# A goal that the server gives up of its own accord, as SimpleActionServer does for a newer one, ends PREEMPTED too: see GoalsToRos1.
TO_ROS2 = {
    Ros1Status.PENDING: Ros2Status.ACCEPTED,
    Ros1Status.ACTIVE: Ros2Status.EXECUTING,
    Ros1Status.PREEMPTING: Ros2Status.CANCELING,
    Ros1Status.RECALLING: Ros2Status.CANCELING,
    Ros1Status.SUCCEEDED: Ros2Status.SUCCEEDED,
    Ros1Status.PREEMPTED: Ros2Status.CANCELED,
    Ros1Status.RECALLED: Ros2Status.CANCELED,
    Ros1Status.ABORTED: Ros2Status.ABORTED,
    Ros1Status.REJECTED: Ros2Status.ABORTED,
    Ros1Status.LOST: Ros2Status.ABORTED,
}
TO_ROS1 = {
    Ros2Status.UNKNOWN: Ros1Status.ABORTED,
    Ros2Status.ACCEPTED: Ros1Status.PENDING,
    Ros2Status.EXECUTING: Ros1Status.ACTIVE,
    Ros2Status.CANCELING: Ros1Status.PREEMPTING,
    Ros2Status.SUCCEEDED: Ros1Status.SUCCEEDED,
    Ros2Status.CANCELED: Ros1Status.PREEMPTED,
    Ros2Status.ABORTED: Ros1Status.ABORTED,
}
