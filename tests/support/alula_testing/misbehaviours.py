"""Hooks that do what they should not: a table of them, with what has to become of the execution; for any world."""

from __future__ import annotations

import asyncio
import math
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from alula.runtime.core import Execution


class Unprintable:
    """Can't be made a text."""

    def __str__(self) -> str:
        """Refuse."""
        raise RuntimeError("no text of me")

    __repr__ = __str__


class UnprintableError(Exception):
    """An exception that can't be made a text."""

    def __str__(self) -> str:
        """Refuse."""
        raise RuntimeError("no text of me either")


@dataclass(frozen=True)
class Misbehaviour:
    """What a hook does, the outcome of its execution, and a part of the message that goes with it."""

    hook: str
    act: Callable[[Any], Any]
    outcome: str = "FAILED"
    says: str = ""


def raising(error: BaseException) -> Callable[[Any], Any]:
    """Return a hook that raises."""

    def act(_: object) -> None:
        raise error

    return act


def returning(value: object) -> Callable[[Any], Any]:
    """Return a hook that returns a value."""
    return lambda _: value


def ending(*arguments: Any, **outputs: Any) -> Callable[[Execution], None]:
    """Return a hook that ends its execution with these arguments of ``terminate``."""

    def act(execution: Execution) -> None:
        execution.terminate(*arguments, outputs=outputs or None)

    return act


def failing(message: Any) -> Callable[[Execution], None]:
    """Return a hook that fails its execution with this message."""

    def act(execution: Execution) -> None:
        execution.fail(message)

    return act


def _ends_and_raises(execution: Execution) -> None:
    execution.terminate("DONE", "done")
    raise RuntimeError("and then broken")


def _ends_three_times(execution: Execution) -> None:
    assert execution.terminate("DONE", "first")
    assert not execution.terminate("DONE", "second")
    assert not execution.fail("third")


def _ends_in_many_threads(execution: Execution) -> None:
    threads = [threading.Thread(target=execution.terminate, args=("DONE", "one of many")) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()


def _bad_outputs(execution: Execution) -> None:
    execution.set_outputs(nonsense=1)


def _recursion(execution: Any) -> None:
    _recursion(execution)


CIRCLE: list[Any] = []
CIRCLE.append(CIRCLE)

MISBEHAVIOURS: dict[str, Misbehaviour] = {
    # validate
    "validate exits": Misbehaviour("validate", raising(SystemExit(3)), says="validate raised SystemExit: 3"),
    "validate interrupts": Misbehaviour("validate", raising(KeyboardInterrupt()), says="validate raised KeyboardInterrupt"),
    "validate is cancelled": Misbehaviour("validate", raising(asyncio.CancelledError()), says="validate raised CancelledError"),
    "validate is closed": Misbehaviour("validate", raising(GeneratorExit()), says="validate raised GeneratorExit"),
    "validate says nothing": Misbehaviour("validate", returning(None), says="validate returned None"),
    "validate says a number": Misbehaviour("validate", returning(5), says="validate returned 5"),
    "validate says yes": Misbehaviour("validate", returning(True), says="validate returned True"),
    "validate says bytes": Misbehaviour("validate", returning(b"no"), says="validate returned b'no'"),
    "validate says no text": Misbehaviour("validate", returning(Unprintable()), says="validate returned a value of type Unprintable"),
    "validate refuses in half a character": Misbehaviour("validate", returning("bad \udcff"), "NOT_VALIDATED", "bad \\udcff"),
    "validate raises many lines": Misbehaviour("validate", raising(ValueError("one\ntwo")), says="validate raised ValueError: one; two"),
    "validate raises no text": Misbehaviour("validate", raising(UnprintableError()), says="validate raised UnprintableError"),
    # on_dispatch
    "dispatch exits": Misbehaviour("on_dispatch", raising(SystemExit()), says="on_dispatch raised SystemExit"),
    "dispatch interrupts": Misbehaviour("on_dispatch", raising(KeyboardInterrupt()), says="on_dispatch raised KeyboardInterrupt"),
    "dispatch never stops calling": Misbehaviour("on_dispatch", _recursion, says="on_dispatch raised RecursionError"),
    "dispatch raises half a character": Misbehaviour("on_dispatch", raising(OSError("\udcff")), says="on_dispatch raised OSError: \\udcff"),
    "ends with an exception": Misbehaviour("on_dispatch", ending("DONE", ValueError("late")), "TERMINATED", "late"),
    "ends with no message": Misbehaviour("on_dispatch", ending("DONE", None), "TERMINATED"),
    "ends with no text": Misbehaviour("on_dispatch", ending("DONE", Unprintable()), "TERMINATED", "a value of type Unprintable"),
    "ends with half a character": Misbehaviour("on_dispatch", ending("DONE", "bad \udcff"), "TERMINATED", "bad \\udcff"),
    "ends with a zero": Misbehaviour("on_dispatch", ending("DONE", "nul \0 nul"), "TERMINATED", "nul \\x00 nul"),
    "ends with a book": Misbehaviour("on_dispatch", ending("DONE", "x" * 10_000_000), "TERMINATED", "characters more"),
    "ends with nonsense": Misbehaviour("on_dispatch", ending("NONSENSE"), says="NONSENSE"),
    "ends with half a result": Misbehaviour("on_dispatch", ending("DO\udcff"), says="DO\\udcff"),
    "ends with no result": Misbehaviour("on_dispatch", ending(None), says="None"),
    "ends with a list": Misbehaviour("on_dispatch", ending(["DONE"]), says="DONE"),
    "ends with unknown outputs": Misbehaviour("on_dispatch", ending("DONE", nonsense=CIRCLE), says="has no output nonsense"),
    "keeps unknown outputs": Misbehaviour("on_dispatch", _bad_outputs, says="has no output nonsense"),
    "ends and raises": Misbehaviour("on_dispatch", _ends_and_raises, "TERMINATED", "done"),
    "ends three times": Misbehaviour("on_dispatch", _ends_three_times, "TERMINATED", "first"),
    "ends in many threads": Misbehaviour("on_dispatch", _ends_in_many_threads, "TERMINATED", "one of many"),
    "fails with an exception": Misbehaviour("on_dispatch", failing(ValueError("late")), says="late"),
    "fails with no text": Misbehaviour("on_dispatch", failing(Unprintable()), says="a value of type Unprintable"),
    "fails with half a character": Misbehaviour("on_dispatch", failing("\ud800"), says="\\ud800"),
    # progress
    "progress is no number": Misbehaviour("progress", returning(math.nan), says="progress returned nan"),
    "progress is infinite": Misbehaviour("progress", returning(math.inf), says="progress returned inf"),
    "progress is a text": Misbehaviour("progress", returning("half"), says="progress returned 'half'"),
    "progress is an object": Misbehaviour("progress", returning(Unprintable()), says="progress returned a value of type Unprintable"),
    "progress exits": Misbehaviour("progress", raising(SystemExit()), says="progress raised SystemExit"),
    "progress ends": Misbehaviour("progress", ending("DONE", "while asked"), "TERMINATED", "while asked"),
    # stops and pauses
    "interruption exits": Misbehaviour("on_interrupt", raising(SystemExit()), says="on_interrupt raised SystemExit"),
    "interruption returns nonsense": Misbehaviour("on_interrupt", returning(Unprintable()), "INTERRUPTED"),
    "interruption ends": Misbehaviour("on_interrupt", ending("DONE", "after all"), "TERMINATED", "after all"),
    "interruption fails": Misbehaviour("on_interrupt", failing(None), says="None"),
    "pause exits": Misbehaviour("on_pause", raising(SystemExit()), says="on_pause raised SystemExit"),
    "pause says yes": Misbehaviour("on_pause", returning(True), says="on_pause returned True"),
    "pause ends": Misbehaviour("on_pause", ending("DONE", "no rest"), "TERMINATED", "no rest"),
    "resumption exits": Misbehaviour("on_resume", raising(SystemExit()), says="on_resume raised SystemExit"),
    "violation exits": Misbehaviour("on_violation", raising(SystemExit()), "RESOURCE_INVARIANT_VIOLATED", "sdk"),
    "violation ends": Misbehaviour("on_violation", ending("DONE"), "RESOURCE_INVARIANT_VIOLATED", "sdk"),
    "failure exits": Misbehaviour("on_failure", raising(SystemExit()), says="asked to"),
    "failure ends": Misbehaviour("on_failure", ending("DONE"), says="asked to"),
}
"""Skills that they are for have a result DONE, can be interrupted, and an invariant over the authority (``sdk`` is in its message)."""
