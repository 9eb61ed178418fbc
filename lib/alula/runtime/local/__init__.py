"""The skillset interface without any middleware: managers and clients of many skillsets in one process, in virtual time."""

from alula.runtime.local.clock import VirtualClock, WorldError
from alula.runtime.local.managers import LocalManagers
from alula.runtime.local.world import LocalClient, LocalWorld
from alula.runtime.timers import Timer

__all__ = [
    "LocalClient",
    "LocalManagers",
    "LocalWorld",
    "Timer",
    "VirtualClock",
    "WorldError",
]
