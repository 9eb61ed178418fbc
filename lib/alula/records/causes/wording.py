"""Faults, ends of executions and reasons of missions in the words of reports and of the page."""

from __future__ import annotations

import re

from alula.common.faults import DIED, MOCKED
from alula.model.execution_state import ExecutionState as S
from alula.runtime.core.events import ExecutionEvent

MEASURES = {"fps": "frames per second", "quality": "picture quality (SSIM)"}
UNITS = {"_m_s": "m/s", "_rad": "rad", "_ms": "ms", "_hz": "Hz", "_bps": "bit/s", "_s": "s", "_m": "m"}
"""By the ends of fields' names."""
_MARGIN = re.compile(r"(?:\w+\.)*(\w+)_margin is -([\d.]+)")
_LINK = re.compile(r"(\w+\.\w+): ([A-Z_]+)((?: \w+)?) \(((?:[^()]|\([^()]*\))*)\)")


def spoken(name: str) -> str:
    """Return a name of the models for a sentence."""
    return name.replace("_", " ").lower()


def fault_text(name: str, mode: str, *, injected: bool) -> str:
    """Return what failed, and in which way, in words; mocks record no way."""
    if injected:
        return f"{spoken(name)} failed ({mode}, injected)" if mode and mode != MOCKED else f"{spoken(name)} failed (injected)"
    return f"the process {name} died" if mode == DIED else f"{spoken(name)} was lost"


def in_words(text: str) -> str:
    """Return a message with its negative margins in words: of "picture.fps_margin is -6" "frames per second: 6 below the limit"."""
    return _MARGIN.sub(_below_the_limit, text)


def _below_the_limit(match: re.Match[str]) -> str:
    name, number = match[1], match[2]
    if name in MEASURES:
        return f"{MEASURES[name]}: {number} below the limit"
    ending = next((one for one in UNITS if name.endswith(one)), "")
    unit = f" {UNITS[ending]}" if ending else ""
    return f"{spoken(name.removesuffix(ending))}: {number}{unit} below the limit"


def reason_in_words(text: str) -> str:
    """Return a mission's reason with the words first: "a.b: CODE name (why)" as "a.b: why (code name)"."""
    return _LINK.sub(lambda match: f"{match[1]}: {match[4]} ({spoken(match[2])}{match[3]})", in_words(text))


def why_of(event: ExecutionEvent) -> str:
    """Return why an execution ended, in words, without the name of the condition or the result; empty where the event has no reason."""
    return in_words(event.message.removeprefix(f"{event.result}: "))


def state_of_affairs(event: ExecutionEvent) -> str:
    """Return what was not as the execution needed it; why it ended otherwise where no condition was unmet."""
    unmet = [in_words(one.reason.removeprefix(f"{one.name}: ")) for one in event.unmet]
    if not unmet:
        return why_of(event)
    # The message of one condition also says for how long it was so, and then what changed.
    return why_of(event).partition(", after ")[0] if len(unmet) == 1 and event.message else "; ".join(unmet)


def end_text(event: ExecutionEvent) -> str:
    """Return how an execution failed, as a sentence."""
    name, why = f"{event.skillset}.{event.skill}", state_of_affairs(event)
    behind = f": {why}" if why else ""
    if event.state is S.RESOURCE_INVARIANT_VIOLATED:
        return f"{name} was stopped, its invariant {event.result} was violated{behind}."
    if event.state is S.NOT_READY:
        return f"{name} could not start, its precondition {event.result} was not met{behind}."
    because = behind or (f": {event.result}" if event.result else "")
    return f"{name} was refused{because}." if event.state is S.NOT_VALIDATED else f"{name} failed{because}."


def state_text(event: ExecutionEvent) -> str:
    """Return the state in which an execution failed, with its result."""
    if event.state is S.RESOURCE_INVARIANT_VIOLATED:
        return "invariant violated"
    return f"{spoken(event.state.value)} {event.result}".strip()
