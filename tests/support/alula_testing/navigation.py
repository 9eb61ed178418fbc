"""What the drone's navigation does over either ROS world alike, as a client of it sees it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Protocol

from geometry_msgs.msg import Point
from skillset_interfaces.srv import Transition

from alula.model.execution_state import ExecutionState
from alula.model.model import Skillset
from alula.runtime.handle import SkillHandle
from alula_testing.recorder import Recorder
from alula_testing.waits import until

S = ExecutionState
FLYING = {"SDK_authority": "AVAILABLE", "homepoint_status": "VALID", "link": "UP", "flight_status": "IN_AIR"}


class Navigation(Protocol):
    """Managers with recorders for hooks, and a client."""

    hooks: Mapping[str, Recorder]
    client: Any

    def bring(self, states: dict[str, str]) -> None:
        """Take extern transitions, as the functional layer does."""
        ...

    def service(self, kind: Any, name: str, /, **request: object) -> Any:
        """Call a service of the skillset; return its answer."""
        ...

    def fly(self) -> SkillHandle:
        """Return an execution of ``goto_straight`` that runs and was dispatched."""
        ...


def check_refusals(navigation: Navigation, soon_s: float) -> None:
    """Check that preconditions, ``validate`` and the model refuse with their reasons."""
    handle = navigation.client.start("goto_straight", target=Point(), speed=1.0)
    assert handle.wait(soon_s)
    assert (handle.state, handle.result) == (S.NOT_READY, "sdk_authority")
    assert "SDK_authority is UNAVAILABLE" in handle.message
    navigation.hooks["takeoff"].acts["validate"] = lambda inputs: f"{inputs.height} m is too high"
    handle = navigation.client.start("takeoff", height=300, speed=1)
    assert handle.wait(soon_s)
    assert (handle.state, handle.message) == (S.NOT_VALIDATED, "300.0 m is too high")
    answer = navigation.service(Transition, "transition", resource="axes_authority", to="USED")
    assert (answer.accepted, answer.state) == (False, "AVAILABLE")
    assert "for skills only" in answer.reason


def check_interrupt_and_violation(navigation: Navigation, soon_s: float) -> None:
    """Check that an interruption, also one that comes at once, and a violation reach the client and the function."""
    hooks = navigation.hooks["goto_straight"]
    navigation.bring(FLYING)
    handle = navigation.fly()
    handle.interrupt()
    assert handle.wait(soon_s)
    assert handle.state is S.INTERRUPTED
    assert hooks.calls.count("on_interrupt") == 1
    early = navigation.client.start("goto_straight", target=(0, 0, 0), speed=1)
    early.interrupt()
    assert early.wait(soon_s)
    assert early.state is S.INTERRUPTED
    handle = navigation.fly()
    navigation.bring({"SDK_authority": "UNAVAILABLE"})
    assert handle.wait(soon_s)
    assert (handle.state, handle.result) == (S.RESOURCE_INVARIANT_VIOLATED, "keep_sdk_authority")
    until(lambda: "on_violation" in hooks.calls, "the function is stopped", soon_s)


def with_silence(skillset: Skillset, name: str, silence_s: float) -> Skillset:
    """Return a skillset with a resource whose reporter may fall silent; its transitions lead both ways, as managers need them to."""
    resource = skillset.resource(name)
    transitions = {
        *resource.transitions,
        *(replace(transition, target=resource.initial, source=transition.target) for transition in resource.transitions),
    }
    silent = replace(
        resource, silence_s=silence_s, transitions=tuple(transition for transition in transitions if transition.source != transition.target)
    )
    return replace(skillset, resources=tuple(silent if one.name == name else one for one in skillset.resources))
