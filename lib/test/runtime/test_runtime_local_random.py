"""Any script without middleware: each execution ends once, and the same script gives the same story."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st
from runtime_local_rig import make, timed

from alula.model.execution_state import ExecutionState
from alula.runtime.core.events import event_record
from alula_testing.runtime_models import flying_skillset

STEPS = st.lists(
    st.one_of(
        st.tuples(st.just("start"), st.integers(0, 1)),
        st.tuples(st.just("interrupt"), st.integers(0, 5)),
        st.tuples(st.just("sdk"), st.sampled_from(["AVAILABLE", "UNAVAILABLE"])),
        st.tuples(st.just("pass"), st.floats(0.0, 1.5)),
        st.tuples(st.just("restart"), st.just(0)),
    ),
    max_size=20,
)


def play(steps, latency_s: float):
    """Run a script; return the events, and the handles."""
    world, _ = make(latency_s=latency_s)
    clients = [world.client("flying") for _ in range(2)]
    story, handles = [], []
    for name in world.managers:
        world.client(name).on_event(lambda event, name=name: story.append(event_record(event)))
    for what, value in steps:
        if what == "start":
            handles.append(clients[value].start("takeoff", height=3.0))
        elif what == "interrupt" and value < len(handles):
            handles[value].interrupt()
        elif what == "sdk":
            clients[0].transition("sdk", value)
        elif what == "pass":
            world.run_for(value)
        elif what == "restart":
            world.kill("flying")
            world.serve(flying_skillset(), timed)
    world.run_for(10.0)
    return story, handles


@settings(max_examples=60)
@given(STEPS, st.sampled_from([0.0, 0.01, 0.3]))
def test_whatever_is_asked_for_each_execution_ends_once_and_the_same_script_gives_the_same_story(steps, latency_s):
    story, handles = play(steps, latency_s)
    assert all(handle.done for handle in handles)
    ends = [
        (record["id"], record["sequence"]) for record in story if record["kind"] == "EXECUTION" and ExecutionState(record["state"]).terminal
    ]
    restarts = sum(what == "restart" for what, _ in steps)
    assert len({identifier for identifier, _ in ends}) == len(ends) or restarts
    again, same = play(steps, latency_s)
    assert again == story
    assert [(h.outcome, h.result, h.message) for h in same] == [(h.outcome, h.result, h.message) for h in handles]
