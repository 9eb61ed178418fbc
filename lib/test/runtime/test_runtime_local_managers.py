"""Managers without middleware: coming and going, what late clients are told, wrong hooks, several at once."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from types import SimpleNamespace

import pytest
from runtime_local_rig import Timed, make, timed

from alula.model.execution_state import ExecutionState
from alula.model.json_form import from_json
from alula.runtime.core.errors import SkillRuntimeError
from alula.runtime.local import LocalWorld, WorldError
from alula.runtime.local.middleware import VirtualMiddleware
from alula.runtime.managers import Managers
from alula_testing.recorder import Recorder
from alula_testing.runtime_models import flying_skillset


def test_managers_that_are_not_there_or_have_gone_leave_no_client_waiting():
    world = LocalWorld()
    client = world.client("flying")
    assert not client.wait_ready(3.0)
    assert world.now_s == 3.0
    stillborn = client.start("takeoff", height=3.0)
    assert (stillborn.outcome, stillborn.message) == ("FAILED", "the managers of flying are not there")
    with pytest.raises(RuntimeError, match="call wait_ready first"):
        _ = client.model
    world.serve(flying_skillset(), timed)
    assert client.wait_ready(0.0)
    assert client.transition("sdk", "AVAILABLE").get(1.0).accepted
    handle = client.start("takeoff", height=3.0)
    world.run_for(0.5)
    world.kill("flying")
    assert handle.wait(0.0)
    assert (handle.outcome, handle.message) == ("FAILED", "the managers of flying have gone: they ended, or sent no heartbeat")
    assert not client.ready
    assert client.start("takeoff", height=3.0).outcome == "FAILED"
    world.serve(flying_skillset(), timed)
    assert client.wait_ready(0.0)
    assert client.resources == {"sdk": "UNAVAILABLE", "axes": "AVAILABLE"}
    with pytest.raises(WorldError, match="already"):
        world.serve(flying_skillset(), timed)


class Hasty(VirtualMiddleware):
    """Clients ask in the very moment that a service or an action is there, as those of managers that were killed do."""

    def __init__(self, bus):
        super().__init__(bus, "flying", model=flying_skillset())
        self.replies = []
        self.ends = []

    def serve(self, service, handler):
        super().serve(service, handler)
        if service == "transition":
            handler({"resource": "sdk", "to": "AVAILABLE", "reason": ""}, self.replies.append)

    def serve_action(self, skill, on_goal, on_cancel):
        server = super().serve_action(skill, on_goal, on_cancel)
        goal = SimpleNamespace(id="early", inputs={"height": 3.0}, report=lambda *_: None, finish=self.ends.append)
        on_goal(goal)
        return server


def test_managers_are_asked_for_nothing_before_they_can_tell_of_it():
    world = LocalWorld()
    hasty = Hasty(world._bus)
    managers = Managers(hasty, flying_skillset(), {"takeoff": Recorder()}, bindings=None)
    world.run_for(1.0)
    assert hasty.errors == []
    assert hasty.replies[0].accepted
    managers.close("over")
    assert [end.id for end in hasty.ends] == ["early"]


def test_a_start_on_its_way_to_managers_that_die_fails():
    world, client = make(latency_s=0.1)
    handle = client.start("takeoff", height=3.0)
    world.kill("flying")
    assert handle.wait(1.0)
    assert handle.outcome == "FAILED"


def test_managers_that_are_shut_down_say_so():
    world, client = make()
    handle = client.start("takeoff", height=3.0)
    world.run_for(0.1)
    world.managers["flying"].close("the managers were shut down")
    late = client.start("takeoff", height=3.0)
    assert handle.wait(0.0)
    assert late.wait(0.0)
    assert (handle.outcome, handle.message) == ("FAILED", "the managers were shut down")
    assert (late.outcome, late.message) == ("NOT_VALIDATED", "the managers were shut down")


def test_a_callback_of_hooks_that_raises_fails_what_runs_and_the_managers_live_on():
    class Raising(Timed):
        def on_dispatch(self, execution) -> None:
            super().on_dispatch(execution)
            self.managers.after(0.5, lambda: 1 / 0)

    world, client = make(hooks=lambda managers: {"takeoff": Raising(managers)})
    handle = client.start("takeoff", height=3.0)
    assert handle.wait(2.0)
    assert (handle.outcome, handle.message) == ("FAILED", "a callback raised ZeroDivisionError: division by zero")
    assert len(world.errors) == 1
    again = client.start("takeoff", height=3.0)
    world.run_for(0.1)
    assert again.state is ExecutionState.RUNNING


def test_a_late_client_is_told_what_latched_topics_hold():
    world, client = make()
    assert client.start("takeoff", height=3.0).wait(2.0)
    late, events, changes = world.client("flying"), [], []
    late.on_event(lambda event: events.append(event.sequence))
    late.on_change(changes.append)
    assert late.resources == {}
    assert late.wait_ready(0.0)
    assert changes == [{"sdk": "AVAILABLE", "axes": "AVAILABLE"}]
    assert events == list(range(1, 7))


def test_managers_describe_themselves():
    world, client = make()
    assert from_json(world.managers["flying"].describe()).skills == client.model.skills


def test_hooks_must_fit_the_model():
    with pytest.raises(SkillRuntimeError, match="no hooks for takeoff"):
        LocalWorld([flying_skillset()], lambda _: {})
    with pytest.raises(WorldError, match="no hooks"):
        LocalWorld([flying_skillset()])


def test_why_and_the_last_end_are_known_to_a_late_client():
    world, client = make()
    assert client.last("takeoff") is None
    first = client.start("takeoff", height=3.0)
    assert first.wait(5.0)
    running = client.start("takeoff", height=3.0)
    late = world.client("flying")
    assert late.wait_ready(0.0)
    last = late.last("takeoff")
    assert (last.id, last.outcome, last.result, last.outputs) == (first.id, "TERMINATED", "DONE", {"reached": 2.5})
    answer = late.why("takeoff").get(1.0)
    assert (answer.ready, [unmet.name for unmet in answer.unmet]) == (False, ["not_moving"])
    running.interrupt()
    assert running.wait(1.0)
    assert late.why("takeoff", {"height": 1.0}).get(1.0).ready
    assert late.last("takeoff").outcome == "INTERRUPTED"
    with pytest.raises(ValueError, match="no skill 'fly'"):
        late.why("fly")


def test_several_skillsets_share_a_clock_and_nothing_else():
    first, second = flying_skillset(), replace(flying_skillset(), name="gliding")
    world = LocalWorld([first, second], timed)
    clients = [world.client(name) for name in ("flying", "gliding")]
    assert all(client.wait_ready(0.0) for client in clients)
    assert clients[0].transition("sdk", "AVAILABLE").get(1.0).accepted
    handles = [client.start("takeoff", height=3.0) for client in clients]
    assert all(handle.wait(2.0) for handle in handles)
    assert [handle.outcome for handle in handles] == ["TERMINATED", "NOT_READY"]
    assert {len(handle.id) for handle in handles} == {12}


def test_no_ros_is_needed():
    code = "import sys, alula.runtime.local; assert not {m for m in sys.modules if m.startswith(('rclpy', 'rospy', 'rosidl'))}"
    subprocess.run([sys.executable, "-c", code], check=True)


def test_the_reason_of_a_state_reaches_clients_with_it_and_also_without_a_transition():
    world = LocalWorld(latency_s=0.01)
    managers = world.serve(flying_skillset(), timed)
    client = world.client("flying")
    changes: list[str] = []
    client.on_change(lambda _: changes.append(client.reasons["sdk"]))
    assert client.wait_ready(1.0)
    reply = managers.transition("sdk", "UNAVAILABLE", "no link")
    assert (reply.accepted, reply.state) == (False, "UNAVAILABLE"), "it is so already: only the reason is new"
    world.run_for(0.1)
    assert (client.resources["sdk"], client.reasons["sdk"]) == ("UNAVAILABLE", "no link")
    assert client.transition("sdk", "AVAILABLE", "the pilot gave it").get(1.0).accepted
    assert managers.transition("sdk", "UNAVAILABLE", "the link is lost").accepted
    assert not managers.transition("sdk", "UNAVAILABLE", "the pilot has it").accepted
    assert not managers.transition("sdk", "UNAVAILABLE", "the pilot has it").accepted
    world.run_for(0.1)
    assert changes[-4:] == ["no link", "the pilot gave it", "the link is lost", "the pilot has it"]
