"""A picture of how the search of missions' runs grows: seconds of the processor over leaves, both logarithmic."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

WIDTH, HEIGHT = 640, 360
LEFT, RIGHT, TOP, BOTTOM = 60, 20, 20, 45
COLOURS = ("#1b6ca8", "#c0392b", "#2e8b57", "#8e44ad")
TIMES_S = (0.01, 0.1, 1.0, 10.0, 100.0)
LEAVES = (1, 10, 100, 1000)


def picture(rows: Sequence[Mapping[str, object]]) -> str:
    """Return it as SVG: a line a family; a hollow point was not searched to the end."""
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" font-family="sans-serif" font-size="12">',
        f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>',
    ]
    for leaves in LEAVES:
        lines.append(f'<path d="M{_x(leaves):.1f} {TOP}V{HEIGHT - BOTTOM}" stroke="#ddd"/>')
        lines.append(f'<text x="{_x(leaves):.1f}" y="{HEIGHT - BOTTOM + 16}" text-anchor="middle">{leaves}</text>')
    for seconds in TIMES_S:
        lines.append(f'<path d="M{LEFT} {_y(seconds):.1f}H{WIDTH - RIGHT}" stroke="#ddd"/>')
        lines.append(f'<text x="{LEFT - 6}" y="{_y(seconds) + 4:.1f}" text-anchor="end">{seconds:g} s</text>')
    lines.append(f'<text x="{WIDTH / 2}" y="{HEIGHT - 8}" text-anchor="middle">leaves that are skills</text>')
    for number, family in enumerate(dict.fromkeys(str(row["family"]) for row in rows)):
        lines += _line(family, [row for row in rows if row["family"] == family], number)
    return "\n".join([*lines, "</svg>"]) + "\n"


def _line(family: str, rows: Sequence[Mapping[str, object]], number: int) -> list[str]:
    colour = COLOURS[number % len(COLOURS)]
    places = [(_x(float(str(row["leaves"]))), _y(float(str(row["cpu_s"]))), bool(row["complete"])) for row in rows]
    path = "L".join(f"{x:.1f} {y:.1f}" for x, y, _ in places)
    points = [
        f'<circle cx="{x:.1f}" cy="{y:.1f}" r="4" stroke="{colour}" fill="{colour if whole else "white"}"/>' for x, y, whole in places
    ]
    name = f'<text x="{LEFT + 12}" y="{TOP + 16 + 16 * number}" fill="{colour}">{family}</text>'
    return [f'<path d="M{path}" stroke="{colour}" fill="none" stroke-width="2"/>', *points, name]


def _x(leaves: float) -> float:
    return LEFT + (WIDTH - LEFT - RIGHT) * _part(leaves, LEAVES)


def _y(seconds: float) -> float:
    return HEIGHT - BOTTOM - (HEIGHT - TOP - BOTTOM) * _part(seconds, TIMES_S)


def _part(value: float, marks: Sequence[float]) -> float:
    low, high = math.log(marks[0]), math.log(marks[-1])
    return min(1.0, max(0.0, (math.log(max(value, marks[0])) - low) / (high - low)))
