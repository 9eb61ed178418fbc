"""A pytest plugin for the end of the tests: SIGTERM ends them as Ctrl-C does, and a thread that keeps Python from ending is named.

Of such a thread the tests fail. rospy's connections have them: one that nobody closes, and the tests hang after they have passed.
"""

from __future__ import annotations

import os
import signal
import threading
import time

import pytest

HANGS_S = 60.0
"""Wall clock after the last test: what ends by itself has ended then."""


def kept_alive() -> list[threading.Thread]:
    """Return the threads for whose ends Python waits."""
    return [thread for thread in threading.enumerate() if not thread.daemon and thread is not threading.main_thread()]


class Ending:
    """Knows after which test a thread was there first."""

    def __init__(self) -> None:
        self._first_after: dict[int | None, str] = {}

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
    config.pluginmanager.register(Ending(), "alula-ending")
