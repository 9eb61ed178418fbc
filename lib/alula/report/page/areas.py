"""The areas that the map shows, which the robot's part ``areas`` reads from its world."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from alula.common.robots import RobotError, find_robot

TONES = ("good", "fair", "bad")
MAX_AREAS = 100


def areas_of(world: str) -> list[dict[str, Any]]:
    """Return the robot's areas in a world file: ``{name, told, tone, box|cylinder|sphere}``, frame map, metres.

    ``told`` says what is so in it, ``tone`` how bad that is: good, fair or bad. ``box``: ``{low, high}``; ``cylinder``, upright:
    ``{at: [x, y], radius_m, z: [from, to]}``; ``sphere``: ``{at, radius_m}``. A world that is not there, as in a run that was elsewhere,
    has none.

    Raises:
        ValueError: the file is no world, or the robot's part makes no sense.
        OSError: it can't be read.
    """
    path = Path(world)
    if not world or not path.is_file():
        return []
    try:
        read = find_robot().part("areas")
    except RobotError as error:
        raise ValueError(str(error)) from None
    if read is None:
        return []
    try:
        return list(_areas(read(path)))
    except (AttributeError, KeyError, TypeError) as error:
        raise ValueError(f"areas of {path.name} can't be read: {error}") from error


def _areas(told: Any) -> Iterator[dict[str, Any]]:
    for area in told[:MAX_AREAS]:
        if area["tone"] not in TONES:
            raise ValueError(f"{area['tone']} is no tone of an area; there are {', '.join(TONES)}")
        yield {"name": str(area["name"]), "told": str(area["told"]), "tone": area["tone"], **_volume(area)}


def _volume(area: Mapping[str, Any]) -> dict[str, Any]:
    if "box" in area:
        return {"box": {corner: _numbers(area["box"][corner], 3) for corner in ("low", "high")}}
    if "cylinder" in area:
        cylinder = area["cylinder"]
        return {"cylinder": {"at": _numbers(cylinder["at"], 2), "radius_m": float(cylinder["radius_m"]), "z": _numbers(cylinder["z"], 2)}}
    return {"sphere": {"at": _numbers(area["sphere"]["at"], 3), "radius_m": float(area["sphere"]["radius_m"])}}


def _numbers(values: Any, count: int) -> list[float]:
    numbers = [float(value) for value in values]
    if len(numbers) != count:
        raise ValueError(f"{numbers} are not {count} numbers")
    return numbers
