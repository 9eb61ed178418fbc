"""The person: walks up and down, waits for the rover to pass, answers it and makes room for it; or stands in its way."""

from __future__ import annotations

import math
from collections.abc import Sequence

WALK_M_S = 0.7
KEEP_M = 1.0  # a person who is so near to the rover, with the rover ahead, waits
ARRIVED_M = 0.1
ANSWER_S = 4.0
Point = tuple[float, ...]


class Person:
    """Decides where the person walks; the floor moves them."""

    def __init__(self, route: Sequence[Point], stays: Point) -> None:
        self._route, self._stays, self._next = route, stays, 1
        self._asked: tuple[str, float] | None = None
        self._waits = False

    def velocity(self, here: Point, rover: Point, *, stays: bool) -> tuple[float, float]:
        """Return (vx, vy): to the next point of the route, or to where they stand in the way. Waits where the rover is ahead."""
        goal = self._stays if stays else self._route[self._next]
        distance, self._waits = math.dist(here, goal), False
        if distance < ARRIVED_M:
            self._next = self._next if stays else (self._next + 1) % len(self._route)
            return 0.0, 0.0
        ahead = ((goal[0] - here[0]) / distance, (goal[1] - here[1]) / distance)
        near = math.dist(here, rover[:2])
        if near < KEEP_M and (rover[0] - here[0]) * ahead[0] + (rover[1] - here[1]) * ahead[1] > 0.0:
            self._waits = True
            return 0.0, 0.0
        return WALK_M_S * ahead[0], WALK_M_S * ahead[1]

    def ask(self, question: str, now_s: float) -> None:
        """Hear a question."""
        self._asked = (question, now_s)

    def answer(self, now_s: float, *, silent: bool) -> str:
        """Return the answer that is given now: ``done QUESTION``; empty: none. Who waits and is asked turns round: the rover waits, too."""
        if silent or self._asked is None or now_s < self._asked[1] + ANSWER_S:
            return ""
        question, self._asked = self._asked[0], None
        if self._waits:
            self._next = (self._next + 1) % len(self._route)
        return f"done {question}"
