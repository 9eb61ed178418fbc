"""Who aborted a run, and why: the first entry counts; and the account of a mission that could not tell its end."""

from __future__ import annotations

import contextlib
import re
import signal
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from alula.common.record import FILE, RecordError, RecordFollower
from alula.common.run_log import END, MISSION, account, note, read
from alula.report.facts import Death

OPERATOR, SUPERVISOR, FRONT, SIGNAL = "operator", "supervisor", "front", "signal"
"""Who ends a run; SIGNAL: a program or a person outside of it."""
TOLD_TO_END = "told to end by "
"""How the reason of a mission begins that was ended by a signal: who had it sent, and why, is for the run to say."""
CLOCK_STANDS = "the mission clock stands still"
"""How the reason begins of a mission that heard no clock any more: it does not know who brought it."""

RUNNING, ABORTED = "running", "aborted"
"""The outcome in the account of a mission that has not told how it ended, and of one that was ended."""
NO_OWN_END = "the mission did not tell how it ended"


@dataclass(frozen=True)
class ReportedAbort:
    """Who aborted a run: ``why`` in words for a person; ``when_s``: absolute mission clock, None where it is not known."""

    by: str
    why: str
    when_s: float | None = None

    def sentence(self) -> str:
        """Return it as a sentence."""
        told = {OPERATOR: "aborted by the operator", SIGNAL: "aborted from outside"}
        return f"{told.get(self.by, f'ended by the {self.by}')}: {self.why}"


def aborted_by_signal(number: signal.Signals | None) -> ReportedAbort:
    """Return what a signal to ``alula run`` means: SIGINT is the operator's Ctrl-C."""
    return (
        ReportedAbort(SIGNAL, f"{number.name} to alula run") if number not in {None, signal.SIGINT} else ReportedAbort(OPERATOR, "Ctrl-C")
    )


def note_abort(out: Path, ended: ReportedAbort) -> None:
    """Write down who aborts the run; it counts unless somebody else has done so already."""
    note(out, END, asdict(ended))


def true_reason(reason: str | None, ended: ReportedAbort | None) -> str | None:
    """Return why a mission was aborted: who ended the run in place of the signal that the mission got; the mission's reason otherwise."""
    return ended.sentence() if ended is not None and (reason or "").startswith(TOLD_TO_END) else reason


def with_dead(reason: str | None, died: Sequence[Death]) -> str | None:
    """Return the reason of a mission, with the processes that had died for good where it received no clock."""
    gone = ", ".join(f"{one['name']} died ({one['how']})" for one in died if one["when_s"] is not None and one["again_s"] is None)
    if reason is None or not gone or not reason.startswith(CLOCK_STANDS):
        return reason
    return re.sub(rf"^{CLOCK_STANDS}( \([^)]*\))?", lambda _: f"{CLOCK_STANDS}: {gone}", reason)


def read_abort(out: Path) -> ReportedAbort | None:
    """Return who aborted the run; None: nobody did, or it is not known."""
    for values in read(out, END):
        with contextlib.suppress(TypeError):
            return ReportedAbort(**values)
    return None


def last_account(out: Path) -> Mapping[str, Any]:
    """Return the mission's last account, of a run with this folder; empty where there is none that can be read."""
    try:
        return account(out, RecordFollower(out / FILE).poll())
    except (OSError, ValueError, RecordError):
        return account(out, [])


def close_account(out: Path, mission_exit: int | None) -> None:
    """Note that a mission was aborted which could not tell it, as its process had died or was not heard, with who ended it or how it died.

    To be called when nothing of the run runs any more. After exit code 0 nothing is noted: the mission had come to its end, and only its
    account is lost.
    """
    told = last_account(out)
    if told.get("outcome") != RUNNING or mission_exit == 0:
        return
    ended = read_abort(out)
    code = "" if mission_exit is None else f" with exit code {mission_exit}"
    why = f"the mission's process ended{code} before the mission did" if ended is None else ended.sentence()
    # An account before the departure does not tell that there was none.
    known = {name: value for name, value in told.items() if value is not None}
    note(out, MISSION, {**known, "outcome": ABORTED, "reason": why, "problems": [*(told.get("problems") or ()), NO_OWN_END]})
