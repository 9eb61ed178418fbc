"""Nav2's own control nodes and decorators, as a plug-in: with ``palette`` Nav2's trees can be ticked.

They do what Nav2's documentation says (https://docs.nav2.org, Behavior Tree XML Nodes). Where a node asks the robot, a method of its class
does (`DistanceController.where`, `SpeedController.speed`): here the robot stands still, a class of one's own overrides it. Nobody sends a
new goal to `GoalUpdater`, nobody asks `PauseResumeController` for a pause. Nav2's actions and conditions are skills of its robot: their
types are in its palette ``nav2_tree_nodes.xml``, their answers are scripted or a robot's own.
"""

from alula.trees.nav2.plugin import palette

__all__ = ["palette"]
