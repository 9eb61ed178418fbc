"""What the truth says of a mission with a fault: how long it moved on, whether it ran into something, how it ended, when it went on."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

ACCOMPLISHED = "accomplished"
MARGIN_S = 1.0
"""So much longer than the dead man's limit may it move, simulated seconds, beside `Still.brakes_s`: a beat that is under way, and
what it takes to stop what has no way to brake."""
COLUMNS = (
    "fault",
    "moved on for, s",
    "unheard for, s",
    "collisions",
    "stood for, s",
    "went on after its end, s",
    "on the ground after its begin, s",
    "mission",
    "cause it says",
)
HEAD = f"| {' | '.join(COLUMNS)} |\n{'|---' * len(COLUMNS)}|\n"


@dataclass(frozen=True)
class Pose:
    """Where the robot truly was: ``at_s`` monotonic clock, ``stamp_s`` simulated time; metres, radians."""

    at_s: float
    stamp_s: float
    x: float
    y: float
    theta: float
    z: float = 0.0


@dataclass(frozen=True)
class Still:
    """A robot that moves and turns no faster stands; one that flies, too, when it sinks: it lands. Before, it brakes for ``brakes_s``."""

    m_s: float = 0.02
    rad_s: float = 0.05
    flies: bool = False
    brakes_s: float = 0.0


STANDS = Still()
GROUND_M = 0.3
"""What flies is down when it is no higher than this over where it began."""


@dataclass(frozen=True)
class Fault:
    """What was done, between two moments of simulated time; ``cause``: words of which a mission that is not accomplished names one.

    ``stops``: as long as it lasts nobody can supervise the robot, so that it has to stand.
    """

    name: str
    begun_s: float
    ended_s: float
    cause: tuple[str, ...]
    stops: bool = True


@dataclass(frozen=True)
class End:
    """How a mission ended, in its own words."""

    outcome: str
    reason: str


@dataclass(frozen=True)
class Verdict:
    """What is told of one mission; seconds of simulated time, None where it did not come to that.

    Attributes:
        moved_on_s: from the fault's begin until it stood; None where it did not because of the fault.
        unheard_s: the longest time for which it moved while nothing was heard of who supervises it.
        stood_s: how long it then stood.
        went_on_s: from the fault's end until it moved again; negative: it moved before that.
        down_s: of one that flies, from the fault's begin until it was on the ground for good.
        collisions: how often it ran into something.
        wrong: what must not be, in words; empty: nothing.
    """

    fault: Fault
    end: End
    moved_on_s: float | None
    unheard_s: float
    stood_s: float | None
    went_on_s: float | None
    down_s: float | None
    collisions: int
    wrong: tuple[str, ...]

    @property
    def row(self) -> str:
        """Return a row of the table whose head is ``HEAD``."""
        cells = (
            self.fault.name,
            _seconds(self.moved_on_s),
            _seconds(self.unheard_s),
            str(self.collisions),
            _seconds(self.stood_s),
            _seconds(self.went_on_s),
            _seconds(self.down_s),
            self.end.outcome,
            self.end.reason.replace("|", "/") or "-",
        )
        return f"| {' | '.join(cells)} |\n"


def judge(
    fault: Fault,
    end: End,
    poses: Sequence[Pose],
    *,
    beats: Sequence[float],
    collisions: int,
    silent_after_s: float,
    following: End | None = None,
    still: Still = STANDS,
) -> Verdict:
    """Judge a mission by where the robot truly was.

    Args:
        fault: what was done meanwhile.
        end: how the mission ended.
        poses: where the robot was, in the order of time.
        beats: when a heartbeat of who supervises it came to the base, simulated time.
        collisions: how often it ran into something.
        silent_after_s: the limit of the base's dead man, simulated seconds.
        following: how the mission after it ended, where there was one: it has to be accomplished.
        still: when it stands.
    """
    limit_s = silent_after_s + MARGIN_S + still.brakes_s
    # It may have stood when the fault came.
    pauses = [(max(begun_s, fault.begun_s), ended_s) for begun_s, ended_s in _pauses(poses, still)]
    stops = [pause for pause in pauses if pause[1] - pause[0] > MARGIN_S]
    # One that comes later has nothing to do with the fault.
    stood = next((pause for pause in stops if pause[0] <= fault.ended_s + limit_s), None)
    moved_on_s = None if stood is None else stood[0] - fault.begun_s
    goes_on = stood is not None and math.isfinite(stood[1])
    lasted_s = fault.ended_s - fault.begun_s if fault.stops else 0.0
    unheard_s = _moved_unheard(poses, beats, still)
    down_s = _down_since(poses, fault.begun_s) if still.flies else None
    wrong = []
    if unheard_s > limit_s:
        wrong.append(_moved_on(unheard_s, limit_s))
    if lasted_s > limit_s and (moved_on_s is None or moved_on_s > limit_s):
        told = "all the time" if moved_on_s is None else f"for {moved_on_s:.1f} s"
        wrong.append(f"it moved on {told}: {limit_s:g} s are allowed")
    if stood is not None and goes_on and lasted_s > limit_s and stood[1] < fault.ended_s:
        wrong.append(f"it moved again {fault.ended_s - stood[1]:.1f} s before the fault's end")
    if still.flies and down_s is None:
        wrong.append("it is in the air still")
    if collisions:
        wrong.append(_ran_into(collisions))
    if end.outcome != ACCOMPLISHED and not any(word in end.reason for word in fault.cause):
        wrong.append(f"the mission ended with '{end.reason}', which names none of: {', '.join(fault.cause)}")
    if following is not None and following.outcome != ACCOMPLISHED:
        wrong.append(f"the next mission was {following.outcome}: {following.reason}")
    return Verdict(
        fault,
        end,
        moved_on_s,
        unheard_s,
        stood[1] - stood[0] if stood is not None and goes_on else None,
        stood[1] - fault.ended_s if stood is not None and goes_on else None,
        down_s,
        collisions,
        tuple(wrong),
    )


@dataclass(frozen=True)
class Survived:
    """How a mission ended during which processes were killed; ``cause``: words of which one is to be named if it was not accomplished."""

    end: End
    cause: tuple[str, ...]


def judge_kills(
    name: str, missions: Sequence[Survived], poses: Sequence[Pose], *, beats: Sequence[float], collisions: int, silent_after_s: float
) -> Verdict:
    """Judge missions that followed each other while processes were killed; the last one was not disturbed, and has to be accomplished."""
    outcomes = Counter(one.end.outcome for one in missions)
    told = [f"{number}: {one.end.reason}" for number, one in enumerate(missions, 1) if one.end.reason]
    end = End(", ".join(f"{count} {outcome}" for outcome, count in sorted(outcomes.items())), "; ".join(told))
    unheard_s, limit_s = _moved_unheard(poses, beats, STANDS), silent_after_s + MARGIN_S
    wrong = [_moved_on(unheard_s, limit_s)] if unheard_s > limit_s else []
    if collisions:
        wrong.append(_ran_into(collisions))
    for number, one in enumerate(missions, 1):
        if one.end.outcome != ACCOMPLISHED and not any(word in one.end.reason for word in one.cause):
            wrong.append(f"mission {number} ended with '{one.end.reason}', which names none of: {', '.join(one.cause)}")
    return Verdict(Fault(name, 0.0, 0.0, ()), end, None, unheard_s, None, None, None, collisions, tuple(wrong))


def _moved_on(unheard_s: float, limit_s: float) -> str:
    return f"it moved for {unheard_s:.1f} s while nothing was heard of its managers: {limit_s:g} s are allowed"


def _ran_into(collisions: int) -> str:
    return f"it ran into something {collisions} times"


def driving_since(poses: Sequence[Pose]) -> float | None:
    """Return since when a robot on the ground moves without a pause, simulated time; None: it stands."""
    pauses = list(_pauses(poses, STANDS))
    if not pauses or math.isfinite(pauses[-1][1]):
        return pauses[-1][1] if pauses else (poses[0].stamp_s if len(poses) > 1 else None)
    return None


def _moved_unheard(poses: Sequence[Pose], beats: Sequence[float], still: Still) -> float:
    """Return the longest time from a heartbeat to a moment at which the robot still moved, no other one having come, seconds."""
    longest_s, index = 0.0, -1
    for before, pose in pairwise(poses):
        while index + 1 < len(beats) and beats[index + 1] <= before.stamp_s:
            index += 1
        if index >= 0 and _moves(before, pose, still):
            longest_s = max(longest_s, pose.stamp_s - beats[index])
    return longest_s


def _moves(before: Pose, pose: Pose, still: Still) -> bool:
    """Return whether the robot moved, rose or turned between two moments."""
    lasted_s = pose.stamp_s - before.stamp_s
    moved_m = math.hypot(pose.x - before.x, pose.y - before.y, max(0.0, pose.z - before.z))
    return moved_m > still.m_s * lasted_s or abs(math.remainder(pose.theta - before.theta, math.tau)) > still.rad_s * lasted_s


def _down_since(poses: Sequence[Pose], begun_s: float) -> float | None:
    """Return how long after a moment it was down for good, seconds (0: it was before); None: it is in the air."""
    above_m = poses[0].z + GROUND_M
    if poses[-1].z > above_m:
        return None
    up_s = next((one.stamp_s for one in reversed(poses) if one.z > above_m), begun_s)
    return max(0.0, up_s - begun_s)


def _pauses(poses: Sequence[Pose], still: Still) -> Iterator[tuple[float, float]]:
    """Return from when until when the robot stood, simulated time; the last one ends at infinity where it stands at the end."""
    begun_s: float | None = None
    for before, pose in pairwise(poses):
        if pose.stamp_s <= before.stamp_s:
            continue
        moves = _moves(before, pose, still)
        if not moves and begun_s is None:
            begun_s = before.stamp_s
        elif moves and begun_s is not None:
            yield begun_s, before.stamp_s
            begun_s = None
    if begun_s is not None:
        yield begun_s, math.inf


def _seconds(value: float | None) -> str:
    return "-" if value is None else f"{value:.1f}"
