"""Reads expectations from YAML; every complaint names file and line."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from alula.common.located_yaml import Located, read_yaml
from alula.records.errors import AnalysisError
from alula.records.expectations.values import TOLERANCE_S, Expectations, ExpectedMoment, Never, Pattern, States

KEYS = ("about", "outcome", "tolerance_s", "order", "complete", "states", "never")
OUTCOMES = ("accomplished", "degraded", "given_up", "aborted", "not_started", "served", "running")
FURTHEST_S = 1e6


def load_expectations(path: Path) -> Expectations:
    """Read a file.

    Raises:
        AnalysisError: it can't be read, or is wrong; the message names file and line.
    """
    document = read_yaml(path, AnalysisError)
    if document is None:
        raise AnalysisError(f"{path}: is empty; expectations may have {', '.join(KEYS)}")
    said = document.record("expectations", KEYS)
    tolerance_s = said["tolerance_s"].number("`tolerance_s`", 0.0) if "tolerance_s" in said else TOLERANCE_S
    return Expectations(
        outcomes=tuple(_outcomes(said["outcome"])) if "outcome" in said else (),
        outcome_place=said["outcome"].place if "outcome" in said else "",
        order=[_group(part, tolerance_s) for part in said["order"].elements()] if "order" in said else (),
        complete="complete" in said and _truth(said["complete"]),
        complete_place=said["complete"].place if "complete" in said else "",
        states=[_states(part) for part in said["states"].elements()] if "states" in said else (),
        never=[_never(part) for part in said["never"].elements()] if "never" in said else (),
    )


def _outcomes(part: Located) -> Iterator[str]:
    for one in part.elements():
        word = one.text("an outcome")
        if word not in OUTCOMES:
            raise one.wrong(f"there is no outcome `{word}`; there are {', '.join(OUTCOMES)}")
        yield word


def _truth(part: Located) -> bool:
    if not isinstance(part.value, bool):
        raise part.wrong(f"`complete` should be true or false, not {part.value!r}")
    return part.value


def _group(part: Located, tolerance_s: float) -> list[ExpectedMoment]:
    """Return one event, or a list of events whose order does not matter."""
    return [_moment(one, tolerance_s) for one in part.elements()]


def _moment(part: Located, tolerance_s: float) -> ExpectedMoment:
    if not part.is_mapping:
        return ExpectedMoment(part.place, _pattern(part))
    said = part.record("an event", ("what", "at_s", "tolerance_s"))
    if "what" not in said:
        raise part.wrong("an event needs `what`, as in {what: drive RUNNING, at_s: 2.5}")
    at_s = said["at_s"].number("`at_s`", -FURTHEST_S, FURTHEST_S) if "at_s" in said else None
    if "tolerance_s" in said:
        tolerance_s = said["tolerance_s"].number("`tolerance_s`", 0.0)
    return ExpectedMoment(part.place, _pattern(said["what"]), at_s, tolerance_s)


def _never(part: Located) -> Never:
    if not part.is_mapping:
        return Never(part.place, _pattern(part))
    said = part.record("what must not happen", ("what", "after"))
    if "what" not in said:
        raise part.wrong("what must not happen needs `what`, as in {what: drive RUNNING, after: bumper PRESSED}")
    return Never(part.place, _pattern(said["what"]), _pattern(said["after"]) if "after" in said else None)


def _states(part: Located) -> States:
    said = part.entries("states")
    if "at_s" not in said:
        raise part.wrong("states need `at_s`, as in {at_s: 31, base.bumper: PRESSED}")
    at_s = said.pop("at_s").number("`at_s`", -FURTHEST_S, FURTHEST_S)
    for name, one in said.items():
        if name.count(".") != 1:
            raise one.wrong(f"`{name}` should be skillset.resource")
    return States(part.place, at_s, [(name, one.text(f"the state of {name}")) for name, one in said.items()])


def _pattern(part: Located) -> Pattern:
    words = part.text("an event").split()
    if not 2 <= len(words) <= 3:
        raise part.wrong("an event is SKILL STATE, SKILL STATE RESULT or RESOURCE STATE, as in drive TERMINATED ARRIVED")
    return Pattern(*words)
