"""A pytest plugin for tests that leave a thread behind which keeps Python from ending: they are named, and the tests fail.

rospy's connections have such threads: one that nobody closes, and the tests hang after they have passed.
"""

from __future__ import annotations

import os
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
    """Begin."""
    config.pluginmanager.register(Ending(), "alula-ending")
