"""``python -m ros_bridge``."""

from ros_bridge.cli import entry

entry()
