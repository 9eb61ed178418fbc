"""What is to fail in a run, and when: ``WHAT[:HOW][@SECONDS[-SECONDS]]``, the one way to write it everywhere.

    zed             dead from the start               zed@30          dead from 30 s after lift-off on
    zed:dark@30     dark from 30 s after lift-off on  zed:dark@30-40  dark for ten seconds, then well again

``HOW`` without a word is the first one that ``WHAT`` knows.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from alula_common.located_yaml import choices

_SECONDS = r"\d+(?:\.\d+)?"
_FAULT = re.compile(rf"(?P<what>[a-z0-9_]+)(?::(?P<how>[a-z0-9_]+))?(?:@(?P<begin>{_SECONDS})(?:-(?P<end>{_SECONDS}))?)?", re.ASCII)
MAX_SECONDS = 1e6


class FaultError(Exception):
    """A fault can't be read, or does not exist; the message quotes it and says what would be right."""


@dataclass(frozen=True)
class FaultRequest:
    """Something that fails.

    Attributes:
        what: the thing.
        how: in which way; empty: the way that the thing knows first.
        begin_s: seconds of mission clock after lift-off; None: from the start of the run.
        end_s: when it is well again, counted alike; None: never.
    """

    what: str
    how: str = ""
    begin_s: float | None = None
    end_s: float | None = None

    def __str__(self) -> str:
        how = f":{self.how}" if self.how else ""
        begin = "" if self.begin_s is None else f"@{_shown(self.begin_s)}"
        end = "" if self.end_s is None else f"-{_shown(self.end_s)}"
        return f"{self.what}{how}{begin}{end}"

    def lasts(self, since_lift_off_s: float | None) -> bool:
        """Tell whether it is there so many seconds after lift-off; None: before it."""
        if self.begin_s is None:
            return True
        return since_lift_off_s is not None and self.begin_s <= since_lift_off_s < (math.inf if self.end_s is None else self.end_s)


def parse_fault(text: str, known: Mapping[str, Sequence[str]] | None = None) -> FaultRequest:
    """Read one fault.

    Args:
        text: as on the command line.
        known: the things that can fail, each with the ways in which it can; None: any, and the caller checks it.

    Raises:
        FaultError: it is not written like that, or there is no such thing or way.
    """
    match = _FAULT.fullmatch(text.strip())
    if match is None:
        raise FaultError(f"fault '{text}': write WHAT, WHAT@SECONDS, WHAT@SECONDS-SECONDS or WHAT:HOW@..., as in zed:dark@30-40")
    begin_s, end_s = (None if match[name] is None else float(match[name]) for name in ("begin", "end"))
    if max(begin_s or 0.0, end_s or 0.0) > MAX_SECONDS:
        raise FaultError(f"fault '{text}': more than {MAX_SECONDS:g} s")
    if begin_s is not None and end_s is not None and end_s <= begin_s:
        raise FaultError(f"fault '{text}': it ends at {end_s:g} s, but begins at {begin_s:g} s")
    fault = FaultRequest(match["what"], match["how"] or "", begin_s, end_s)
    if known is not None:
        _check(fault, text, known)
    return fault


def parse_faults(text: str, known: Mapping[str, Sequence[str]] | None = None) -> list[FaultRequest]:
    """Read faults between commas; raises FaultError."""
    return [parse_fault(word, known) for word in text.split(",") if word.strip()]


def _check(fault: FaultRequest, text: str, known: Mapping[str, Sequence[str]]) -> None:
    if fault.what not in known:
        raise FaultError(f"fault '{text}': there is no '{fault.what}' to break; choose one of {choices(fault.what, known)}")
    ways = known[fault.what]
    if fault.how and fault.how not in ways:
        raise FaultError(f"fault '{text}': {fault.what} can't be '{fault.how}'; choose one of {choices(fault.how, ways)}")


def _shown(seconds: float) -> str:
    """Return the seconds in digits that read back as the same number."""
    return f"{seconds:.6f}".rstrip("0").rstrip(".")
