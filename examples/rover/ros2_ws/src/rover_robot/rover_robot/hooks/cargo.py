"""The hooks of the skillset `cargo`: people and doors."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from alula import SkillHooks
from cargo_managers.hooks import AbstractAskSkill, AbstractLoadSkill, AbstractOpenDoorSkill, AbstractUnloadSkill
from skillset_ros2 import ServiceSkill, Watch
from std_msgs.msg import String
from std_srvs.srv import SetBool

if TYPE_CHECKING:
    from collections.abc import Mapping

    from alula import Execution
    from cargo_managers.inputs import OpenDoorInputs
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
        watch.every(self._look, lambda: self._execution is not None)

    def text(self, inputs: object) -> str:
        """Return what is said."""
        return str(inputs.text)  # type: ignore[attr-defined]

    def on_dispatch(self, execution: Execution) -> None:
        """Say it."""
        self._asked_s, self._execution = self._watch.now_s, execution
        self._watch.wake()
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


class OpenDoor(ServiceSkill, AbstractOpenDoorSkill):
    """Calls the building's service of the door; an interruption waits no more: a door may be open."""

    service, server, answer_s = SetBool, "door", DOOR_S
    results: ClassVar[Mapping[bool, str]] = {True: "OPEN", False: "SHUT"}
    lost = "UNREACHABLE"

    def server_for(self, inputs: OpenDoorInputs) -> str:
        """Return the service of the door."""
        return f"{self.server}/{inputs.door}/open"

    def request(self, _inputs: object) -> SetBool.Request:
        """Ask for the door to be opened."""
        return SetBool.Request(data=True)


def make_hooks(node: Node) -> dict[str, SkillHooks]:
    """Make the hooks of all skills."""
    watch = Watch(node)
    return {"ask": Ask(node, watch), "load": Load(node, watch), "unload": Unload(node, watch), "open_door": OpenDoor(watch)}
