"""Nav2's own nodes: as its headers declare them, and classes for those that need no robot.

``registry`` has all of them. Its control nodes and those decorators that look at nothing but their children, the clock and the blackboard
do what Nav2's documentation says (https://docs.nav2.org, Behavior Tree XML Nodes). All others, its actions and conditions among them, are
declarations: ports, what may take several ticks, what is read unchecked. They are drawn and checked; to tick them is scripted, or a
robot's own.
"""

from alula.trees.nav2.declared import RELEASES, WRITTEN, declared
from alula.trees.nav2.plugin import registry, registry_for, told_of

__all__ = ["RELEASES", "WRITTEN", "declared", "registry", "registry_for", "told_of"]
