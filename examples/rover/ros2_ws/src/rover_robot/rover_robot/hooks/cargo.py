"""The hooks of the skillset `cargo`: people and doors."""

from __future__ import annotations

from typing import TYPE_CHECKING

from alula import SkillHooks
from cargo_managers.hooks import AbstractAskSkill, AbstractLoadSkill, AbstractOpenDoorSkill, AbstractUnloadSkill
from std_msgs.msg import String
from std_srvs.srv import SetBool

from rover_robot.hooks.clock import Watch

if TYPE_CHECKING:
    from alula import Execution
    from rclpy.client import Client
    from rclpy.node import Node

ANSWER = "done "
"""Whoever answers says this before what was asked."""
DOOR_S = 8.0


class Question(SkillHooks):
    """Says something, and waits for the answer to it."""

    answered = "ANSWERED"

    def __init__(self, node: Node, watch: Watch) -> None:
        super().__init__()
        self._watch = watch
        self._execution: Execution | None = None
        self._asked_s = 0.0
        self._voice = node.create_publisher(String, "person/ask", 5)
        node.create_subscription(String, "person/answer", self._on_answer, 5)
        watch.every(self._look)

    def text(self, inputs: object) -> str:
        """Return what is said."""
        return str(inputs.text)  # type: ignore[attr-defined]

    def on_dispatch(self, execution: Execution) -> None:
        """Say it."""
        self._asked_s, self._execution = self._watch.now_s, execution
        self._voice.publish(String(data=self.text(execution.inputs)))

    def on_interrupt(self, execution: Execution) -> None:
        """Wait no more."""
        if execution is self._execution:
            self._execution = None

    def _on_answer(self, message: String) -> None:
        execution = self._execution
        if execution is not None and message.data == ANSWER + self.text(execution.inputs):
            self._execution = None
            execution.terminate(self.answered)

    def _look(self) -> None:
        execution = self._execution
        if execution is not None and self._watch.now_s - self._asked_s > execution.inputs.patience:
            self._execution = None
            execution.terminate("NOBODY", message=f"no answer to: {self.text(execution.inputs)}")


class Ask(Question, AbstractAskSkill):
    """Anything."""


class Load(Question, AbstractLoadSkill):
    """For a parcel."""

    answered = "LOADED"

    def text(self, inputs: object) -> str:
        """Return what is said."""
        return f"Please put the parcel {inputs.parcel} into my box."  # type: ignore[attr-defined]


class Unload(Question, AbstractUnloadSkill):
    """To be relieved of one."""

    answered = "UNLOADED"

    def text(self, inputs: object) -> str:
        """Return what is said."""
        return f"Please take the parcel {inputs.parcel} out of my box."  # type: ignore[attr-defined]


class OpenDoor(AbstractOpenDoorSkill):
    """Calls the building's service of the door."""

    def __init__(self, node: Node, watch: Watch) -> None:
        self._node, self._watch = node, watch
        self._execution: Execution | None = None
        self._clients: dict[str, Client[SetBool.Request, SetBool.Response]] = {}
        self._called_s = 0.0
        watch.every(self._look)

    def on_dispatch(self, execution: Execution) -> None:
        """Call it."""
        self._called_s, self._execution = self._watch.now_s, execution
        service = self._client(execution.inputs.door)
        service.call_async(SetBool.Request(data=True)).add_done_callback(lambda future: self._on_answer(execution, future.result()))

    def on_interrupt(self, execution: Execution) -> None:
        """Wait no more: a door may be open."""
        if execution is self._execution:
            self._execution = None

    def _client(self, door: str) -> Client[SetBool.Request, SetBool.Response]:
        """Return the one client of a door."""
        if door not in self._clients:
            self._clients[door] = self._node.create_client(SetBool, f"door/{door}/open")
        return self._clients[door]

    def _on_answer(self, execution: Execution, answer: SetBool.Response) -> None:
        if execution is self._execution:
            self._execution = None
            end = self.terminated_OPEN if answer.success else self.terminated_SHUT
            end(execution, answer.message)

    def _look(self) -> None:
        execution = self._execution
        if execution is not None and self._watch.now_s - self._called_s > DOOR_S:
            self._execution = None
            self.terminated_UNREACHABLE(execution, f"the building does not answer for {DOOR_S:g} s")


def make_hooks(node: Node) -> dict[str, SkillHooks]:
    """Make the hooks of all skills."""
    watch = Watch(node)
    return {name: make(node, watch) for name, make in (("ask", Ask), ("load", Load), ("unload", Unload), ("open_door", OpenDoor))}
