"""What is to fail in a run, and when: ``WHAT[:HOW][@SECONDS[-SECONDS]]``, the one way to write it everywhere; and what did.

    zed             dead from the start               zed@30          dead from 30 s after lift-off on
    zed:dark@30     dark from 30 s after lift-off on  zed:dark@30-40  dark for ten seconds, then well again

``HOW`` without a word is the first one that ``WHAT`` knows. What broke something in a run, be it a simulator, a supervisor or mocks,
tells each change as JSON: ``{"sensor": "zed", "mode": "dark", "t_s": 32.5}``, and mode ``ok`` when it ended.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from alula.common.errors import AlulaError
from alula.common.located_yaml import choices
from alula.common.public import public

_SECONDS = r"\d+(?:\.\d+)?"
_FAULT = re.compile(rf"(?P<what>[a-z0-9_]+)(?::(?P<how>[a-z0-9_]+))?(?:@(?P<begin>{_SECONDS})(?:-(?P<end>{_SECONDS}))?)?", re.ASCII)
MAX_SECONDS = 1e6
MENDED = "ok"
"""The mode of what works again."""
DIED = "died"
"""The way of failing of a process that ended without being told to."""
MOCKED = "mock"
"""The mode of what failed in mocks without a word for the way of failing."""


@public("alula.parts")
class FaultError(AlulaError):
    """A fault can't be read, or does not exist; the message quotes it and says what would be right."""


@public("alula.parts")
@dataclass(frozen=True)
class FaultRequest:
    """A fault that is asked for: what fails, how, and when.

    Attributes:
        what: the thing.
        how: the way of failing; empty: the first one of the thing.
        begin_s: seconds of mission clock after lift-off; None: from the start of the run.
        end_s: when it ends, counted alike; None: never.
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

    def span(self, begun_s: float, origin_s: float | None) -> tuple[float, float]:
        """Return from when to when it is there, seconds of mission clock; infinity: never.

        Args:
            begun_s: when a fault without a time is there first.
            origin_s: when the event was that its times count from, lift-off; None: it never came.
        """
        if origin_s is None:
            return (begun_s if self.begin_s is None else math.inf), math.inf
        at_s = begun_s if self.begin_s is None else origin_s + self.begin_s
        return at_s, math.inf if self.end_s is None else origin_s + self.end_s

    def lasts(self, since_lift_off_s: float | None) -> bool:
        """Return whether it is there so many seconds after lift-off; None: before it."""
        if self.begin_s is None:
            return True
        return since_lift_off_s is not None and self.begin_s <= since_lift_off_s < (math.inf if self.end_s is None else self.end_s)


@public("alula.parts")
@dataclass(frozen=True)
class FaultChange:
    """Something failed at ``t_s``, absolute seconds of mission clock, or works again: then the mode is MENDED."""

    sensor: str
    mode: str
    t_s: float


@dataclass(frozen=True)
class FaultSpan:
    """A fault that came: what was asked for, and from when to when it was there, absolute seconds of mission clock."""

    request: FaultRequest
    at_s: float
    until_s: float


def spans_of(
    requests: Sequence[FaultRequest],
    *,
    begun_s: float,
    lift_off_s: float | None,
    ended_s: float,
    first_s: Mapping[str, float] | None = None,
) -> list[FaultSpan]:
    """Return the faults that came of those that were asked for, in the order of time.

    Args:
        requests: as on the command line.
        begun_s: when the run began, absolute seconds of mission clock, as the others.
        lift_off_s: None: it never lifted off, and what was to come after that did not come.
        ended_s: when it was over; what was to come later did not come.
        first_s: when mocks say that each fault came first, by its name in their behaviour, for its times can count from another event;
            what is not there did not come. None: times count from lift-off.
    """
    found = []
    for request in requests:
        at_s, origin_s = begun_s, lift_off_s
        if first_s is not None:
            name = _name_in(first_s, request)
            if name not in first_s:
                continue
            at_s = first_s[name]
            begins = [other.begin_s for other in requests if _name_in(first_s, other) == name]
            if None not in begins:
                origin_s = at_s - min(begin_s for begin_s in begins if begin_s is not None)
        span = FaultSpan(request, *request.span(at_s, origin_s))
        if span.at_s <= ended_s:
            found.append(span)
    return sorted(found, key=lambda span: span.at_s)


def _name_in(names: Mapping[str, float], request: FaultRequest) -> str:
    """Return the name of a fault in a behaviour: the one for the way of failing, else the one for the thing."""
    full = f"{request.what}:{request.how}"
    return full if full in names else request.what


def changes_of(spans: Sequence[FaultSpan], ended_s: float, mode: str) -> list[FaultChange]:
    """Return all begins and ends until the end of a run, in the order of time; ``mode`` of what fails without a word for the way."""
    changes = [FaultChange(span.request.what, span.request.how or mode, span.at_s) for span in spans]
    changes += [FaultChange(span.request.what, MENDED, span.until_s) for span in spans if span.until_s <= ended_s]
    return sorted(changes, key=lambda change: change.t_s)


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
        raise FaultError(f"fault '{text}': write WHAT, WHAT@SECONDS, WHAT@SECONDS-SECONDS or WHAT:HOW@..., as in camera:dark@30-40")
    begin_s, end_s = (None if match[name] is None else float(match[name]) for name in ("begin", "end"))
    if max(begin_s or 0.0, end_s or 0.0) > MAX_SECONDS:
        raise FaultError(f"fault '{text}': more than {MAX_SECONDS:g} s")
    if begin_s is not None and end_s is not None and end_s <= begin_s:
        raise FaultError(f"fault '{text}': it ends at {end_s:g} s, but begins at {begin_s:g} s")
    fault = FaultRequest(match["what"], match["how"] or "", begin_s, end_s)
    if known is not None:
        check_fault(fault, known, text)
    return fault


@public("alula.parts")
def parse_faults(text: str, known: Mapping[str, Sequence[str]] | None = None) -> list[FaultRequest]:
    """Read a list of faults with commas between them, as `--fail` has each; raise FaultError."""
    return [parse_fault(word, known) for word in text.split(",") if word.strip()]


def check_fault(fault: FaultRequest, known: Mapping[str, Sequence[str]], text: str = "") -> None:
    """Refuse a fault that is not in ``known``, ways of failing by thing; ``text``: as the user wrote it. Raises FaultError."""
    text = text or str(fault)
    if fault.what not in known:
        raise FaultError(f"fault '{text}': there is no '{fault.what}' to break; choose one of {choices(fault.what, known)}")
    ways = known[fault.what]
    if fault.how and fault.how not in ways:
        raise FaultError(f"fault '{text}': {fault.what} can't be '{fault.how}'; choose one of {choices(fault.how, ways)}")


def _shown(seconds: float) -> str:
    """Return the seconds in digits that read back as the same number."""
    return f"{seconds:.6f}".rstrip("0").rstrip(".")
