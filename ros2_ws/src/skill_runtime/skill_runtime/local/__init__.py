"""The skillset interface without any middleware: managers and clients of many skillsets in one process, in virtual time."""

from skill_runtime.local.clock import VirtualClock, WorldError
from skill_runtime.local.managers import LocalManagers
from skill_runtime.local.world import LocalClient, LocalWorld
from skill_runtime.timers import Timer

__all__ = [
    "LocalClient",
    "LocalManagers",
    "LocalWorld",
    "Timer",
    "VirtualClock",
    "WorldError",
]
