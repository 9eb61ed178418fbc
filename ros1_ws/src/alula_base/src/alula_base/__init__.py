"""The part of Alula on the robot's own computer that stops the robot when the decision side is silent."""

from alula_base.errors import ConfigError
from alula_base.heartbeats import Change, Heartbeats

__all__ = ["Change", "ConfigError", "Heartbeats"]
