"""Ctrl-C, once and twice, and an event that a signal's handler may set."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable

from alula.common.public import public

END_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


@public("alula.parts")
class StopEvent(threading.Event):
    """An event that handlers of signals may set at any time, also while the main thread waits for it.

    The lock of a plain event is not its thread's own: a handler that sets it while the main thread holds it waits for ever.
    """

    def __init__(self) -> None:
        super().__init__()
        self._cond = threading.Condition(threading.RLock())


class Interrupts:
    """Counts the requests to end (Ctrl-C, SIGTERM, SIGHUP): the first ends in order, the second at once.

    ``on_first`` and ``on_second`` are called in the main thread, between two instructions of what it does: they must not wait.
    """

    def __init__(self, on_first: Callable[[], None], on_second: Callable[[], None]) -> None:
        self._on_first = on_first
        self._on_second = on_second
        self._received: list[signal.Signals] = []

    def install(self) -> None:
        """Handle the signals from now on; call it in the main thread."""
        for number in END_SIGNALS:
            signal.signal(number, lambda received, _frame: self._note(signal.Signals(received)))

    @property
    def asked(self) -> bool:
        """Return whether the end was requested."""
        return bool(self._received)

    @property
    def first(self) -> signal.Signals | None:
        """The signal that asked for the end; None when none has."""
        return self._received[0] if self._received else None

    @property
    def at_once(self) -> bool:
        """Return whether the end was requested twice: at once."""
        return len(self._received) > 1

    def _note(self, received: signal.Signals) -> None:
        self._received.append(received)
        if len(self._received) == 1:
            self._on_first()
        else:
            self._on_second()


def on_end_signal(callback: Callable[[signal.Signals], None]) -> None:
    """Call back with each SIGINT, SIGTERM or SIGHUP, in the main thread; call this there, too."""
    for number in END_SIGNALS:
        signal.signal(number, lambda received, _frame: callback(signal.Signals(received)))
