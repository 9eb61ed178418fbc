"""The errors of the bridge; each message names the value, the place and the remedy."""

from __future__ import annotations


class BridgeError(Exception):
    """Root of all errors of this package."""


class ConfigError(BridgeError):
    """A configuration can't be used; the message begins with ``file:line``."""


class WorldError(BridgeError):
    """Something of the ROS 2 world is not as the bridge needs it."""


class NoMasterError(BridgeError):
    """There is no ROS master, and the options do not say to wait for one."""


class TypeUnknownError(BridgeError):
    """A message or service type has no definition in one of the worlds, or none that both could have."""


class TypeDiffersError(BridgeError):
    """ROS 1 and ROS 2 lay out a type of the same name differently."""


class WireError(BridgeError):
    """Bytes from a peer are not what its type says."""
