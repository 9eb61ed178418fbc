"""What the map shows of the space to fly in: the world's radio zones, and the fence."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import yaml

from alula.common.robots import RobotError, find_robot

QUALITIES = ("good", "degraded", "critical")
MAX_ZONES = 100


def areas_of(world: str) -> dict[str, Any]:
    """Return the zones of a world file and the robot's fence: ``{fence, radio: [{name, quality, box|cylinder|sphere}]}``.

    Frame map, metres; a robot without a fence has None there.

    A world that is not there, as in a run that was flown elsewhere, has no zones.

    Raises:
        ValueError: the file is no world.
        OSError: it can't be read.
    """
    path = Path(world)
    return {"fence": _fence(), "radio": list(_zones(path)) if world and path.is_file() else []}


def _fence() -> Any:
    """Return the upright cylinder about home in which the robot stays, heights above home."""
    try:
        return find_robot().page.get("fence")
    except RobotError:
        return None


def _zones(path: Path) -> Iterator[dict[str, Any]]:
    try:
        world = yaml.safe_load(path.read_text(encoding="utf-8"))
        for zone in (world.get("radio_zones") or [])[:MAX_ZONES]:
            quality = str(zone["quality"])
            yield {"name": str(zone["name"]), "quality": quality if quality in QUALITIES else "critical", **_volume(zone)}
    except yaml.YAMLError as error:  # its own words quote the file
        raise ValueError(f"{path.name} is no YAML: {getattr(error, 'problem', None) or 'its text is damaged'}") from error
    except (AttributeError, KeyError, TypeError) as error:
        raise ValueError(f"radio_zones of {path.name} can't be read: {error}") from error


def _volume(zone: Mapping[str, Any]) -> dict[str, Any]:
    if "box" in zone:
        return {"box": {corner: _numbers(zone["box"][corner], 3) for corner in ("low", "high")}}
    if "cylinder" in zone:
        cylinder = zone["cylinder"]
        return {"cylinder": {"at": _numbers(cylinder["at"], 2), "radius_m": float(cylinder["radius_m"]), "z": _numbers(cylinder["z"], 2)}}
    return {"sphere": {"at": _numbers(zone["sphere"]["at"], 3), "radius_m": float(zone["sphere"]["radius_m"])}}


def _numbers(values: Any, count: int) -> list[float]:
    numbers = [float(value) for value in values]
    if len(numbers) != count:
        raise ValueError(f"{numbers} are not {count} numbers")
    return numbers
