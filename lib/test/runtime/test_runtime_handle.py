"""Handles and answers without middleware: every waiting caller is woken once, in its own way, and every reader sees every change."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable
from typing import Any

import pytest

from alula.model.execution_state import ExecutionState
from alula.runtime.handle import HandleReport, SkillFailedError, SkillHandle, StillRunningError
from alula.runtime.waiting import Moment, NoResponseError, Pending
from alula_testing.waits import HANGS_S

S = ExecutionState


def handle() -> SkillHandle:
    return SkillHandle("takeoff", "1")


def follow(one: SkillHandle) -> None:
    one.run(0.25, {"height": 1.0})
    one.run(0.25, {"height": 1.0})  # nothing new
    one.run(0.5, {"height": 2.0})
    one.end(S.TERMINATED, "DONE", "there", {"height": 3.0})
    one.end(S.FAILED, "", "too late")
    one.run(0.75, {"height": 9.0})


REPORTS = [
    HandleReport(S.REQUESTED, 0.0, {}),
    HandleReport(S.RUNNING, 0.25, {"height": 1.0}),
    HandleReport(S.RUNNING, 0.5, {"height": 2.0}),
    HandleReport(S.TERMINATED, 0.5, {"height": 3.0}),
]


def test_an_execution_has_one_end():
    one, ends = handle(), []
    one.add_done_callback(ends.append)
    assert one.ended is None
    follow(one)
    one.add_done_callback(ends.append)
    assert ends == [one, one]
    ended = one.get(0.0)
    assert (ended.outcome, ended.result, ended.message, ended.outputs) == ("TERMINATED", "DONE", "there", {"height": 3.0})
    assert ended.expect("DONE") is ended.expect() is ended
    with pytest.raises(SkillFailedError, match=r"takeoff should have ended with HIGH or HIGHER, but TERMINATED \(DONE: there\)"):
        ended.expect("HIGH", "HIGHER")


def test_a_message_that_begins_with_the_name_of_its_reason_does_not_get_it_twice():
    one = handle()
    one.end(S.NOT_READY, "idle", "idle: mapping_process is RUNNING")
    assert str(one.ended) == "NOT_READY (idle: mapping_process is RUNNING)"


def test_an_end_that_is_no_result_is_never_expected():
    one = handle()
    one.fail("gone")
    with pytest.raises(SkillFailedError, match=r"ended with a result, but FAILED \(gone\)"):
        one.get(0.0).expect()


def test_time_that_is_up_says_where_the_execution_is():
    one = handle()
    one.run()
    assert not one.wait(0.01)
    with pytest.raises(StillRunningError, match=r"takeoff is RUNNING and has not ended within 0\.01 s"):
        one.get(0.01)


def test_readers_in_threads_see_every_change_and_stop_at_the_end():
    one = handle()
    seen: list[list[HandleReport]] = [[], []]
    readers = [one.reports(), iter(one)]
    threads = [threading.Thread(target=lambda i=i: seen[i].extend(readers[i])) for i in range(2)]
    for thread in threads:
        thread.start()
    follow(one)
    for thread in threads:
        thread.join(HANGS_S)
    assert seen == [REPORTS, REPORTS]
    assert list(one) == REPORTS[-1:]  # a late reader


def test_a_listener_that_raises_keeps_no_caller_waiting():
    one = handle()
    one.on_report(lambda report: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        one.fail("gone")
    assert one.wait(0.0)


def test_asyncio_awaits_and_iterates():
    async def main() -> None:
        one = handle()
        thread = threading.Thread(target=lambda: (gate.wait(HANGS_S), follow(one)))
        gate = threading.Event()
        thread.start()

        async def read() -> list[HandleReport]:
            return [report async for report in one]

        reading = asyncio.create_task(read())
        await asyncio.sleep(0)  # one turn of the loop: the reader waits now
        gate.set()
        ended = await asyncio.wait_for(one, HANGS_S)
        assert ended.result == "DONE"
        assert await asyncio.wait_for(reading, HANGS_S) == REPORTS
        assert (await one) == ended  # at once
        thread.join(HANGS_S)

    asyncio.run(main())


def test_an_await_that_is_cancelled_leaves_nothing_behind():
    one = handle()

    async def main() -> None:
        with pytest.raises(asyncio.TimeoutError):
            await asyncio.wait_for(one, 0.01)
        assert one._after == []
        waiting = asyncio.ensure_future(asyncio.wait_for(one, HANGS_S))
        await asyncio.sleep(0)  # one turn of the loop: it waits now
        waiting.cancel()

    asyncio.run(main())
    one.fail("after the loop was closed")
    assert one.done


def test_a_coroutine_without_a_loop_is_resumed_by_its_driver():
    one = handle()

    async def waits() -> str:
        return (await one).outcome

    coroutine = waits()
    for _ in range(3):
        assert coroutine.send(None) is None
    one.fail("gone")
    with pytest.raises(StopIteration) as stopped:
        coroutine.send(None)
    assert stopped.value.value == "FAILED"


def test_an_answer_comes_once_or_says_why_not():
    answer: Pending[str] = Pending()
    with pytest.raises(NoResponseError, match="still under way"):
        answer.get(0.01)
    seen: list[str] = []
    answer.add_done_callback(lambda pending: seen.append(pending.value))
    answer.resolve("yes")
    answer.resolve("no")
    answer.fail("gone")
    assert (answer.get(0.0), seen, answer.failure) == ("yes", ["yes"], "")
    lost: Pending[str] = Pending()
    lost.fail("gone")

    async def main() -> None:
        with pytest.raises(NoResponseError, match="gone"):
            await lost

    asyncio.run(main())


class Meddled:
    """A lock at whose every release another thread gets in between, with what it does."""

    def __init__(self, meddle: Callable[[], object]) -> None:
        self._lock = threading.Lock()
        self._meddle = meddle
        self._inside = False

    def __enter__(self) -> None:
        self._lock.acquire()

    def __exit__(self, *_: object) -> None:
        self._lock.release()
        if not self._inside:
            self._inside = True
            self._meddle()
            self._inside = False


@pytest.mark.parametrize("value", [None, "", "yes"])
def test_an_answer_stands_whatever_comes_in_between(value):
    given: Pending[Any] = Pending()
    refused: Pending[Any] = Pending()
    ends: list[str] = []
    for answer in (given, refused):
        answer.add_done_callback(lambda answer: ends.append(answer.failure or repr(answer.value)))
    given._lock = Meddled(lambda: given.fail("gone"))
    refused._lock = Meddled(lambda: refused.resolve(value))
    given.resolve(value)
    refused.fail("")
    assert (given.done, given.failure, given.value) == (True, "", value)
    assert refused.done
    with pytest.raises(NoResponseError, match="there is no answer"):
        _ = refused.value
    assert ends == [repr(value), "there is no answer"]


def test_an_end_stands_whatever_comes_in_between():
    one = handle()
    ends: list[str] = []
    one.add_done_callback(lambda ended: ends.append(ended.outcome))
    one._lock = Meddled(lambda: one.fail("gone"))
    one.end(S.TERMINATED, "DONE", "")
    assert (one.outcome, one.result, one.message, ends) == ("TERMINATED", "DONE", "", ["TERMINATED"])


def test_a_moment_comes_once_whatever_comes_in_between():
    moment = Moment()
    ends: list[str] = []
    moment.call_at_end(lambda: ends.append("there"))
    moment._lock = Meddled(moment.come)
    moment.come()
    assert ends == ["there"]


def test_pauses_are_asked_for_where_there_are_managers_to_ask():
    asked: list[bool] = []

    def pause(paused: bool) -> Pending[str]:  # noqa: FBT001 - the client's signature
        asked.append(paused)
        answer: Pending[str] = Pending()
        answer.resolve("")
        return answer

    one = SkillHandle("takeoff", "1", pause=pause)
    assert (one.pause().value, one.resume().value, asked) == ("", "", [True, False])
    one.fail("gone")
    assert one.pause().value == "takeoff has ended"
    assert handle().pause().value == "takeoff can't be paused"
