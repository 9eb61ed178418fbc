"""The processes of the benchmark: started, asked, and ended with their parent; and what one has taken."""

from __future__ import annotations

import multiprocessing
import os
import signal
import traceback
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, Self

ANSWER_S = 60.0
END_S, TERM_S = 8.0, 2.0
TICKS_A_SECOND = os.sysconf("SC_CLK_TCK")
Body = Callable[[Connection, Any], None]
Handlers = Mapping[str, Callable[..., object]]


class BenchError(Exception):
    """A process of the benchmark does not do what it should."""


class Child:
    """A process of our own that runs ``body(connection, argument)`` in a DDS domain; it ends at the latest with this one.

    ``body`` takes orders as ``follow`` does. Ended when the block is left: asked first, killed when it does not hear.
    """

    def __init__(self, name: str, domain: int, body: Body, argument: object = None) -> None:
        self.name = name
        spawn = multiprocessing.get_context("spawn")
        self._connection, other = spawn.Pipe()
        self._process = spawn.Process(target=_run, args=(domain, body, other, argument), name=name, daemon=True)
        self._process.start()
        other.close()

    @property
    def pid(self) -> int:
        """Process id."""
        assert self._process.pid is not None  # noqa: S101 - it was started
        return self._process.pid

    def order(self, word: str, *values: object) -> None:
        """Give an order; ``answer`` is to be called once for each."""
        try:
            self._connection.send((word, values))
        except OSError as error:
            raise BenchError(f"the {self.name} ended before its time") from error

    def answer(self, limit_s: float = ANSWER_S) -> Any:
        """Return the answer to an order. Raises BenchError when there is none within the time (wall clock)."""
        try:
            if not self._connection.poll(limit_s):
                raise BenchError(f"the {self.name} did not answer within {limit_s:g} s")
            value, error = self._connection.recv()
        except (EOFError, OSError) as gone:
            raise BenchError(f"the {self.name} ended before its time") from gone
        if error:
            raise BenchError(f"the {self.name}: {error}")
        return value

    def ask(self, word: str, *values: object) -> Any:
        """Give an order and return its answer."""
        self.order(word, *values)
        return self.answer()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        # The end of the connection is the order to end: it comes even when this process was killed.
        self._connection.close()
        for end, limit_s in ((None, END_S), (self._process.terminate, TERM_S), (self._process.kill, None)):
            if end is not None:
                end()
            self._process.join(limit_s)
            if not self._process.is_alive():
                return


def follow(connection: Connection, handlers: Handlers) -> None:
    """Do what is ordered, until the other end of the connection is closed; an error is an answer, too."""
    for word, values in _orders(connection):
        try:
            reply = (handlers[word](*values), "")
        except Exception as error:  # noqa: BLE001 - told to the process that ordered it
            reply = (None, "".join(traceback.format_exception_only(error)).strip())
        connection.send(reply)


def _orders(connection: Connection) -> Iterator[tuple[str, tuple[Any, ...]]]:
    while True:
        try:
            yield connection.recv()
        except (EOFError, OSError):
            return


def _run(domain: int, body: Body, connection: Connection, argument: object) -> None:
    # Ctrl-C goes to all of the terminal's processes; only the first of them decides.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.environ["ROS_DOMAIN_ID"] = str(domain)
    body(connection, argument)


@dataclass(frozen=True)
class Usage:
    """What a process has taken so far (processor) and holds now (memory)."""

    cpu_s: float
    rss_mb: float


def usage(pid: int) -> Usage:
    """Return what a process takes, from /proc (proc(5): fields 14 and 15 of stat, VmRSS)."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    status = Path(f"/proc/{pid}/status").read_text(encoding="utf-8")
    return Usage((int(fields[11]) + int(fields[12])) / TICKS_A_SECOND, int(status.split("VmRSS:")[1].split()[0]) / 1024)
