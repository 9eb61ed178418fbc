"""The registry of BehaviorTree.CPP 4's own nodes."""

from __future__ import annotations

from alula.trees.node import Node
from alula.trees.nodes import branches, decorators, entries, leaves, loops, parallel, sequences
from alula.trees.registry import NodeRegistry

NODES: tuple[type[Node], ...] = (
    sequences.Sequence,
    sequences.AsyncSequence,
    sequences.SequenceWithMemory,
    sequences.ReactiveSequence,
    sequences.Fallback,
    sequences.AsyncFallback,
    sequences.ReactiveFallback,
    parallel.Parallel,
    parallel.ParallelAll,
    branches.IfThenElse,
    branches.WhileDoElse,
    *branches.SWITCHES,
    branches.TryCatch,
    decorators.Inverter,
    decorators.ForceSuccess,
    decorators.ForceFailure,
    decorators.Repeat,
    decorators.RetryUntilSuccessful,
    decorators.KeepRunningUntilFailure,
    decorators.Delay,
    decorators.Timeout,
    decorators.RunOnce,
    decorators.Precondition,
    *loops.LOOPS,
    entries.SkipUnlessUpdated,
    entries.WaitValueUpdate,
    entries.SetBlackboard,
    entries.UnsetBlackboard,
    entries.WasEntryUpdated,
    leaves.ScriptCondition,
    leaves.Sleep,
    leaves.AlwaysSuccess,
    leaves.AlwaysFailure,
)


def standard_registry() -> NodeRegistry:
    """Return them; to be added to by a robot's own."""
    registry = NodeRegistry()
    for node in NODES:
        registry.register(node)
    registry.register(leaves.ScriptNode, "Script")
    return registry
