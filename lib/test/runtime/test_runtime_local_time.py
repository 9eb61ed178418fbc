"""Virtual time: jobs, waits and coroutines."""

from __future__ import annotations

import pytest
from runtime_local_rig import make

from alula.model.execution_state import ExecutionState
from alula.runtime.local import LocalWorld, VirtualClock, WorldError
from alula.runtime.waiting import CannotWaitError
from alula_testing.recorder import Recorder
from alula_testing.runtime_models import flying_skill, flying_skillset


def test_time_jumps_from_job_to_job_in_the_order_of_their_moments():
    clock, done = VirtualClock(start_s=10.0), []
    clock.after(2.0, lambda: done.append(("second", clock.now_s)))
    clock.after(1.0, lambda: clock.soon(lambda: done.append(("begotten", clock.now_s))))
    clock.after(1.0, lambda: done.append(("first", clock.now_s)))
    clock.after(1.5, lambda: done.append(("never", clock.now_s))).cancel()
    while clock.do_next(20 * 10**9):
        pass
    assert done == [("first", 11.0), ("begotten", 11.0), ("second", 12.0)]
    assert clock.now_s == 20.0


def test_a_moment_that_has_passed_is_now():
    clock = VirtualClock(start_s=5.0)
    assert clock.at(0, lambda: None).when_ns == 5 * 10**9


def test_jobs_that_beget_each_other_without_end_are_an_error():
    world = LocalWorld()

    def again() -> None:
        world.clock.soon(again)

    again()
    with pytest.raises(WorldError, match="time stands still at 0 s"):
        world.run_for(1.0)


def test_a_wait_is_bounded_by_the_mission_clock():
    world, client = make()
    handle = client.start("takeoff", height=3.0)
    assert not handle.wait(0.25)
    assert world.now_s == 0.25
    assert handle.state is ExecutionState.RUNNING


def test_nothing_has_happened_when_start_returns_and_latency_delays_both_ways():
    world, client = make(latency_s=0.1)
    begun_s = world.now_s
    handle = client.start("takeoff", height=3.0)
    assert world.run_until(lambda: handle.state is ExecutionState.RUNNING, timeout_s=5.0)
    assert world.now_s - begun_s == pytest.approx(0.2)


def test_waiting_inside_a_job_is_an_error_and_no_deadlock():
    world, client = make()
    complaints: list[str] = []

    def wait_there(handle) -> None:
        try:
            client.start("takeoff", height=3.0).wait(1.0)
        except CannotWaitError as error:
            complaints.append(str(error))

    client.start("takeoff", height=3.0).add_done_callback(wait_there)
    world.run_for(2.0)
    assert complaints == ["the world runs already: a job can't wait for it; use add_done_callback or on_change there"]


def test_coroutines_run_in_virtual_time():
    world, client = make()

    async def mission() -> list[object]:
        first = await client.start("takeoff", height=3.0)
        reports = [report async for report in client.start("takeoff", height=4.0)]
        taken = await client.transition("sdk", "UNAVAILABLE")
        return [first.result, reports[-2].progress, reports[-1].state, taken.accepted, world.now_s]

    result, progress, state, accepted, now_s = world.run(mission())
    assert (result, progress, state, accepted, now_s) == ("DONE", pytest.approx(0.9), ExecutionState.TERMINATED, True, 2.0)

    async def endless() -> None:
        await client.moment()

    with pytest.raises(WorldError, match="has not ended within 5 s"):
        world.run(endless(), timeout_s=5.0)


def test_a_wait_for_what_can_not_come_is_refused():
    _, client = make(hooks=lambda _: {"takeoff": Recorder()}, skillset=flying_skillset(flying_skill("takeoff", progress=None)))
    handle = client.start("takeoff", height=3.0)
    with pytest.raises(CannotWaitError, match="nothing can happen in this world any more"):
        list(handle)
