"""The random models and programs again, over the real adapter: managers in one node, and in nodes that are linked as processes are."""

from __future__ import annotations

import threading
from dataclasses import replace

import pytest

rclpy = pytest.importorskip("rclpy")
navigation_actions = pytest.importorskip("navigation_interfaces.action")

from hypothesis import HealthCheck, Phase, given, settings  # noqa: E402
from hypothesis import strategies as st  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402
from skillset_ros2_rig import NUMBERS, READY_S, NavigationRecorder, Spinning, until  # noqa: E402

from alula.model.model import Progress  # noqa: E402
from alula.runtime.core import ExecutionEvent  # noqa: E402
from alula_testing.random_models import (  # noqa: E402
    BEHAVIOURS,
    JOIN_S,
    PROGRAMS,
    SKILLS,
    check_effects,
    check_executions,
    check_hooks,
    check_invariants,
    check_records,
    check_resources,
    give_hooks,
    skillsets,
)
from skillset_ros2 import SkillsetClient, SkillsetNode  # noqa: E402
from skillset_ros2.convert import fields_of, values_of  # noqa: E402
from skillset_ros2.names import action_type  # noqa: E402

NAMES = dict(zip(SKILLS, ("land", "hover", "takeoff"), strict=True))
"""Skills of the random model, and those of the navigation whose actions they have."""
STOP_S = 0.3


class LiveBench:
    """What ``Bench`` is to the engine, over rclpy; ``handles`` are the callers', ``known`` the executions as hooks see them."""

    def __init__(self, model, spinning: Spinning, *, separate: bool) -> None:
        skills = tuple(replace(skill, name=NAMES[skill.name], progress=Progress(0.05)) for skill in model.skills)
        self.skillset = replace(model, name="navigation", skills=skills)
        self.hooks = {skill.name: NavigationRecorder() for skill in skills}
        self.steps: list = []
        self.handles: list = []
        self.known: list = []
        self.replies = [0, 0]  # wishes to pause, and answers
        self.spinning = spinning
        # Each example has a namespace of its own: DDS forgets the nodes of the last one only after a while.
        self.place = {"namespace": f"race{next(NUMBERS)}"}
        limit = [Parameter("interrupt_timeout_s", value=STOP_S)]
        hooks = spinning.elsewhere(self.skillset, self.hooks) if separate else (lambda _: self.hooks)
        self.managers = spinning.spin(
            SkillsetNode(self.skillset, navigation_actions, hooks, data_bindings={}, parameter_overrides=limit, **self.place)
        )
        self.managers.managers.on_step.insert(0, lambda events: self.steps.append(tuple(events)))
        self.engine = self.managers.engine

    def connect(self) -> None:
        node = Node(f"skill_runtime_racer_{next(NUMBERS)}", **self.place)
        self.client = SkillsetClient(node, "navigation")
        assert self.client.wait_ready(READY_S)
        self.spinning.spin(node)

    @property
    def events(self) -> list:
        return [event for step in self.steps for event in step]

    def states(self) -> dict[str, str]:
        return {name: status.state for name, status in self.engine.resources.items()}

    def perform(self, operation) -> None:
        match operation:
            case ("request", skill):
                goal = action_type(navigation_actions, NAMES[skill]).Goal()
                assert fields_of(goal) is not None
                self.handles.append(self.client.start(NAMES[skill], **values_of(goal)))
            case ("transition", resource, to):
                self.engine.transition(resource, to)
            case ("interrupt", index) if self.handles:
                self.handles[index % len(self.handles)].interrupt()
            case ("pause" | "resume" as what, index) if self.handles:
                self.replies[0] += 1
                self.engine.set_paused(self.handles[index % len(self.handles)].id, self.count, paused=what == "pause")
            case ("terminate", index, result) if self.known:
                self.known[index % len(self.known)].terminate(result)
            case ("fail" | "interrupted" as what, index) if self.known:
                getattr(self.known[index % len(self.known)], what)(what)

    def count(self, _) -> None:
        self.replies[1] += 1

    def keep(self) -> None:
        """Have what is dispatched known."""
        for recorder in self.hooks.values():
            before = recorder.acts["on_dispatch"]
            recorder.acts["on_dispatch"] = lambda execution, before=before: (self.known.append(execution), before(execution))[1]


def check_callers(bench: LiveBench) -> None:
    """Each caller has the end of the execution that it has asked for."""
    ends = {event.id: event for event in bench.events if isinstance(event, ExecutionEvent) and event.state.terminal}
    assert len({handle.id for handle in bench.handles}) == len(bench.handles)
    assert set(ends) == {handle.id for handle in bench.handles}, [(handle, handle.message) for handle in bench.handles]
    for handle in bench.handles:
        end = ends[handle.id]
        assert (handle.skill, handle.outcome, handle.result, handle.message) == (end.skill, end.state.value, end.result, end.message)


@pytest.mark.parametrize("separate", [False, True], ids=["single", "separate"])
@settings(
    max_examples=6,
    phases=[Phase.explicit, Phase.reuse, Phase.generate],
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
@given(skillsets(), st.fixed_dictionaries({NAMES[name]: BEHAVIOURS for name in SKILLS}), PROGRAMS)
def test_every_caller_gets_its_end_and_every_trace_obeys_the_model(ros2_domain, separate, model, behaviours, programs):
    spinning = Spinning()
    try:
        bench = LiveBench(model, spinning, separate=separate)
        running: list[tuple[str, str, str]] = []
        give_hooks(bench, behaviours, running)
        bench.keep()
        bench.connect()
        threads = [threading.Thread(target=lambda p=p: [bench.perform(one) for one in p], daemon=True) for p in programs]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(JOIN_S)
        assert not any(thread.is_alive() for thread in threads), "deadlock"
        for handle in bench.handles:
            handle.interrupt()
        assert all(handle.wait(JOIN_S) for handle in bench.handles), [handle for handle in bench.handles if not handle.done]
        until(lambda: bench.replies[0] == bench.replies[1], "every wish to pause is answered")
        until(lambda: all(running.count((i, h, "begin")) == running.count((i, h, "end")) for i, h, _ in running), "hooks return")
        check_resources(bench)
        check_executions(bench)
        check_effects(bench)
        check_invariants(bench)
        check_hooks(running)
        check_records(bench)
        check_callers(bench)
    finally:
        spinning.close()
