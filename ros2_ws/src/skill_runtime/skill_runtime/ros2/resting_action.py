"""Action clients that an executor waits for only while an answer is due to them.

rclpy's executor gathers all entities of a node at each of its turns, so a client of a hundred skills would pay for all of them with
each message, though it uses one or two. Clients rest by their callback group: what ``can_execute`` denies is not waited for.
"""

from __future__ import annotations

from typing import Any

from rclpy.action import ActionClient
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup


class RestingActionClient(ActionClient):  # type: ignore[misc]  # rclpy has no types
    """Rests, in a ``RestingGroup``, unless it awaits an answer.

    Whoever wants feedback asks for the result: while that is awaited, feedback and status come, too. What comes while the client
    rests stays in the queues of DDS, and is dropped or ignored when it is used next.
    """

    @property
    def awaits(self) -> bool:
        """Tell whether a goal's acceptance, a result or a cancellation's answer is due."""
        return bool(self._pending_goal_requests or self._pending_result_requests or self._pending_cancel_requests)

    def send_goal_async(self, goal: Any, feedback_callback: Any = None, goal_uuid: Any = None) -> Any:
        """Send a goal, as rclpy's does."""
        # rclpy forgets goals when their last status comes, which a client that rests may miss.
        for known, handle in list(self._goal_handles.items()):
            if handle() is None:
                self._goal_handles.pop(known, None)
        return self._roused(super().send_goal_async(goal, feedback_callback, goal_uuid))

    def _get_result_async(self, goal_handle: Any) -> Any:
        return self._roused(super()._get_result_async(goal_handle))

    def _cancel_goal_async(self, goal_handle: Any) -> Any:
        return self._roused(super()._cancel_goal_async(goal_handle))

    def _roused(self, future: Any) -> Any:
        """Have the executor gather its entities anew: it may be waiting without this one."""
        executor = self._node.executor
        if executor is not None:
            executor.wake()
        return future


class RestingGroup(MutuallyExclusiveCallbackGroup):  # type: ignore[misc]
    """Runs one callback at a time, and lets action clients rest that await nothing."""

    def can_execute(self, entity: Any) -> bool:
        """Tell whether the executor should wait for an entity, and may call back."""
        if isinstance(entity, RestingActionClient) and not entity.awaits:
            return False
        return bool(super().can_execute(entity))
