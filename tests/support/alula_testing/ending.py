"""A pytest plugin for the end of the tests: SIGTERM ends them as Ctrl-C does, and what keeps them from ending is named.

That is a thread, for whose end Python waits: rospy's connections have them, one that nobody closes is enough. Or a call in C that never
returns and keeps the interpreter, so that its test's own timeout can't end it. Of either the tests fail.
"""

from __future__ import annotations

import faulthandler
import os
import signal
import threading
import time
from collections.abc import Iterator

import pytest

HANGS_S = 60.0
"""Wall clock after the last test: what ends by itself has ended then."""
WATCHDOG_S = 30.0
"""Wall clock after a test's timeout: what that can end has ended then."""


def timeout_s(item: pytest.Item) -> float:
    """Return the timeout of a test, 0 where it has none."""
    marker = item.get_closest_marker("timeout")
    return float(marker.args[0] if marker else item.config.getini("timeout") or 0.0)


def kept_alive() -> list[threading.Thread]:
    """Return the threads for whose ends Python waits."""
    return [thread for thread in threading.enumerate() if not thread.daemon and thread is not threading.main_thread()]


class Ending:
    """Knows after which test a thread was there first, and watches over each test's end.

    Args:
        errors: the file descriptor that stacks are written to.
    """

    def __init__(self, errors: int) -> None:
        self._errors = errors
        self._first_after: dict[int | None, str] = {}

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        """End the process, with all stacks, where a test with its fixtures has not ended well after its timeout."""
        if limit_s := timeout_s(item):
            faulthandler.dump_traceback_later(limit_s + WATCHDOG_S, exit=True, file=self._errors)
        try:
            return (yield)
        finally:
            faulthandler.cancel_dump_traceback_later()

    def pytest_runtest_logfinish(self, nodeid: str) -> None:
        """Look which threads are there."""
        alive = {thread.ident for thread in kept_alive()}
        self._first_after = {ident: self._first_after.get(ident, nodeid) for ident in alive}

    @pytest.hookimpl(trylast=True)
    def pytest_unconfigure(self) -> None:
        """Let Python end, but not wait for ever."""
        threading.Thread(target=self._end, daemon=True).start()

    def _end(self) -> None:
        time.sleep(HANGS_S)
        for thread in kept_alive():
            first = self._first_after.get(thread.ident, "the last test")
            os.write(2, f"alula test: the thread {thread.name} keeps the tests from ending; it was there first after {first}\n".encode())
        os._exit(pytest.ExitCode.TESTS_FAILED)


def pytest_configure(config: pytest.Config) -> None:
    """Begin. Where Ctrl-C is ignored, as in the background of a script, fixtures end what they started all the same."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    config.pluginmanager.register(Ending(os.dup(2)), "alula-ending")  # pytest keeps the usual one to itself
