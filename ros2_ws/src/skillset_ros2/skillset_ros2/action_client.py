"""A client of an action that loses no response, for hooks and tools that call action servers."""

from __future__ import annotations

import threading
from typing import Any

from rclpy.action import ActionClient as RclpyActionClient  # noqa: TID251


class ActionClient(RclpyActionClient):  # type: ignore[misc]  # rclpy ships no types
    """A thread-safe client of an action, which rclpy's own is not.

    rclpy 7.1.6 sends a request first and notes it then, without a lock: a response that the spinning thread takes in between is dropped
    ("Ignoring unexpected goal response"), and its future never ends. Here responses wait until their request is noted.
    """

    def __new__(cls, node: Any, kind: type, name: str, **_: Any) -> Any:
        """Return a client; the node of a replay makes one that the record answers."""
        recorded = getattr(node, "create_action_client", None)
        return super().__new__(cls) if recorded is None else recorded(kind, name)

    def __init__(self, *arguments: Any, **options: Any) -> None:
        self._noting = threading.RLock()
        super().__init__(*arguments, **options)

    def take_data(self) -> Any:
        """Take what has arrived; called by the executor."""
        with self._noting:
            return super().take_data()

    def send_goal_async(self, *arguments: Any, **options: Any) -> Any:
        """Send a goal, as rclpy's; from any thread."""
        with self._noting:
            return super().send_goal_async(*arguments, **options)

    # What the handle of a goal calls.

    def _get_result_async(self, goal_handle: Any) -> Any:
        with self._noting:
            return super()._get_result_async(goal_handle)

    def _cancel_goal_async(self, goal_handle: Any) -> Any:
        with self._noting:
            return super()._cancel_goal_async(goal_handle)
