"""Managers that start where others have left functions running: nothing is taken before these were stopped."""

from __future__ import annotations

import threading

import pytest
from runtime_local_rig import Timed

from alula.model.execution_state import ExecutionState
from alula.runtime.core.engine import SkillsetEngine
from alula.runtime.local import LocalWorld
from alula.runtime.middleware import RESOURCE_STATES
from alula_testing.recorder import Recorder
from alula_testing.runtime_models import flying_skillset
from alula_testing.waits import HANGS_S

S = ExecutionState


class Starting(Timed):
    """Stops what ran before."""

    def __init__(self, managers, act=lambda: None) -> None:
        super().__init__(managers)
        self.started, self._act = 0, act

    def on_start(self) -> None:
        self.started += 1
        self._act()


def world_of(act) -> tuple[LocalWorld, Starting]:
    made = []

    def make(managers):
        made.append({skill.name: Starting(managers, act) for skill in managers.skillset.skills})
        return made[0]

    return LocalWorld([flying_skillset()], make), next(iter(made[0].values()))


def test_managers_are_there_when_what_ran_before_was_stopped():
    world, hooks = world_of(lambda: None)
    shown = []
    world._bus.topic(f"flying/{RESOURCE_STATES.name}").subscribers.append(shown.append)
    client = world.client("flying")
    assert not client.ready
    assert hooks.started == 0
    assert "have just started" in world._bus.topic(f"flying/{RESOURCE_STATES.name}").values[-1].resources["axes"].reason
    assert client.wait_ready(1.0)
    assert hooks.started == 1
    assert client.reasons == {"sdk": "", "axes": ""}
    assert client.transition("sdk", "AVAILABLE").get(1.0).accepted
    assert client.start("takeoff", height=3.0).get(10.0).result == "DONE"
    assert hooks.started == 1


def test_a_skill_that_could_not_stop_what_ran_takes_nothing_and_says_why():
    def fail() -> None:
        raise ValueError("the rotors still turn")

    world, _ = world_of(fail)
    client = world.client("flying")
    assert client.wait_ready(1.0)
    assert client.transition("sdk", "AVAILABLE").get(1.0).accepted
    handle = client.start("takeoff", height=3.0)
    assert handle.wait(1.0)
    assert handle.outcome == "NOT_VALIDATED"
    assert handle.message.startswith("takeoff could not stop what ran of it before: on_start raised ValueError: the rotors still turn")
    assert "the rotors still turn" in client.why("takeoff").get(1.0).reason


class Held(Recorder):
    """Waits in ``on_start`` for the test."""

    def __init__(self) -> None:
        super().__init__()
        self.go = threading.Event()

    def on_start(self) -> None:
        self.go.wait()


@pytest.mark.parametrize("limit_s", [None, 0.01], ids=["returns", "hangs"])
def test_no_request_is_taken_before_and_a_hook_that_hangs_holds_up_its_own_skill_only(limit_s):
    hooks = {skill.name: Held() for skill in flying_skillset().skills}
    events, begun = [], threading.Event()
    engine = SkillsetEngine(flying_skillset(), lambda: 0, hooks, events.extend, hook_timeout_s=limit_s, on_error=lambda _: None)
    engine.start(engine.skills_to_start, lambda job: threading.Thread(target=job, daemon=True).start(), begun.set)
    execution = engine.request("takeoff", {}) if limit_s is None else None
    if execution is not None:
        assert (execution.state, execution.message) == (S.NOT_VALIDATED, "what ran before has yet to be stopped: takeoff")
        assert engine.explain("takeoff").reason.startswith("what ran before has yet to be stopped")
        hooks["takeoff"].go.set()
    assert begun.wait(HANGS_S)
    engine.transition("sdk", "AVAILABLE")
    execution = engine.request("takeoff", {})
    if limit_s is None:
        assert execution.state is S.RUNNING
    else:
        assert "on_start has not returned within 0.01 s" in execution.message
        hooks["takeoff"].go.set()
