"""The palette of Nav2's own nodes."""

from __future__ import annotations

from alula.trees.nav2 import controls, decorators
from alula.trees.node import Node
from alula.trees.palette import Palette

NODES: tuple[type[Node], ...] = (
    controls.PipelineSequence,
    controls.RecoveryNode,
    controls.RoundRobin,
    controls.NonblockingSequence,
    controls.PersistentSequence,
    controls.PauseResumeController,
    decorators.RateController,
    decorators.DistanceController,
    decorators.SpeedController,
    decorators.SingleTrigger,
    decorators.GoalUpdater,
    decorators.GoalUpdatedController,
    decorators.PathLongerOnApproach,
)


def palette() -> Palette:
    """Return Nav2's nodes."""
    known = Palette()
    for node in NODES:
        known.register(node)
    return known
