"""Judges a flight: is its outcome one that a flight may have, and is the cause that the operator is told one of the faults in effect."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import yaml

from flight_judge.truth import Broken, Truth

LATE_S = 6.0
"""A fault that has ended can still be the cause for so long: monitors wait up to 3 s, and a motion is given up within 5.1 s."""
EARLY_S = 0.06
"""The managers' clock ticks at 50 Hz: what they tell may be stamped some ticks before what caused it."""
CLOCK_BY, CLOCK_S = "ros_bridge", 0.5
"""The process that brings the clock to the mission, and how long after its end the clock has stopped."""
SUPERVISOR, HUNG = "supervisor", re.compile("limit|stands still")
"""A run that its supervisor ends because something died is over; one that only a limit ends, or a person, hangs."""
UNFINISHED = {"running", "not_started", "None"}
RADIO = ("radio", "control")
"""What the radio's emulation breaks is told by nothing but its request: it does what it is asked for."""


@dataclass(frozen=True)
class Claim:
    """What the operator was told: the outcome, its reason, and when the skill failed that it names first, seconds after lift-off.

    None where it names none that failed.
    """

    outcome: str
    reason: str
    failed_s: float | None


@dataclass(frozen=True)
class Verdict:
    """What is wrong with a flight, in words; empty: nothing. ``cause``: the fault that the claim was found true by."""

    wrong: tuple[str, ...] = ()
    cause: str = ""


Words = Mapping[str, re.Pattern[str]]
"""By fault, ``zed`` or ``zed:late``: what a true reason may name."""


def read_words(path: Path) -> Words:
    """Read the table of a robot."""
    return {fault: re.compile(pattern) for fault, pattern in yaml.safe_load(path.read_text(encoding="utf-8")).items()}


def claim_of(summary: Mapping[str, Any]) -> Claim:
    """Take from a flight's summary what the operator is told, and nothing else."""
    reason = str(summary.get("reason") or "")
    named = re.match(r"(\w+)\.(\w+):", reason)
    ends = [one for one in summary.get("skills") or () if named and (one["skillset"], one["skill"]) == named.groups()]
    failed = [
        one["end_s"]
        for one in ends
        if one.get("end_s") is not None and one.get("result_kind") != "success" and one.get("outcome") != "INTERRUPTED"
    ]
    return Claim(str(summary.get("outcome")), reason, min(failed, default=None))


def with_radio(truth: Truth, asked: Sequence[str]) -> Truth:
    """Return the truth with the radio's faults, as they were asked for: ``radio:out@4-9``."""
    found = []
    for text in asked:
        name, _, times = text.partition("@")
        what, _, how = name.partition(":")
        begin_s, _, end_s = times.partition("-")
        if what in RADIO:
            found.append(Broken(what, how, float(begin_s or 0.0), float(end_s or "inf")))
    return replace(truth, broken=tuple(sorted((*truth.broken, *found), key=lambda one: one.at_s)))


def judge(claim: Claim, truth: Truth, words: Words) -> Verdict:
    """Judge one flight."""
    wrong = []
    if truth.collisions is None:
        wrong.append("the simulator tells nothing")
    elif truth.collisions:
        wrong.append(f"collisions: {truth.collisions}")
    if truth.crash:
        wrong.append(f"crashed: {truth.crash}")
    if truth.at_rest is False:
        wrong.append("not at rest in the end")
    if truth.ended_by and (truth.ended_by != SUPERVISOR or HUNG.search(truth.ended_why)):
        wrong.append(f"hung: {truth.ended_why}")
    elif claim.outcome in UNFINISHED and not truth.ended_by:
        wrong.append(f"never over: {claim.outcome}")
    told = replace(claim, reason=claim.reason or (truth.ended_why if truth.ended_by == SUPERVISOR else ""))
    if not told.reason:
        return Verdict(tuple(wrong))
    cause = cause_of(told, truth, words)
    if not cause:
        wrong.append(f"untrue cause: {told.reason}")
    return Verdict(tuple(wrong), cause)


def _failed(claim: Claim, truth: Truth) -> tuple[float, float]:
    """Return from when to when the failure was: the decision's clock, by which it is told, stands while no bridge brings it."""
    if claim.failed_s is None:
        return -math.inf, math.inf
    stood = [one for one in truth.broken if one.what == CLOCK_BY and abs(one.at_s - claim.failed_s) < CLOCK_S]
    return claim.failed_s, max((one.until_s for one in stood), default=claim.failed_s)


def cause_of(claim: Claim, truth: Truth, words: Words) -> str:
    """Return the fault that a reason names and that was in effect when the first skill failed; empty: there is none."""
    begin_s, end_s = _failed(claim, truth)
    for one in truth.broken:
        pattern = words.get(f"{one.what}:{one.how}") or words.get(one.what)
        there = one.at_s <= end_s + EARLY_S and begin_s <= one.until_s + LATE_S
        if there and pattern is not None and pattern.search(claim.reason):
            return f"{one.what}:{one.how}"
    return ""
