"""The file of a world: what the rover's part of it says. IR-SIM reads the key ``irsim`` by itself."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from rover_simulator.errors import WorldError

Point = tuple[float, ...]


@dataclass(frozen=True)
class World:
    """A world; metres and radians, frame map.

    Attributes:
        path: its file.
        dock: pose (x, y, yaw) in which the rover is charged.
        person_route: points between which the person walks up and down.
        person_stays: where a person stands who is in the way.
        kidnapped: pose that the rover is carried to when its localisation is to be lost.
        obstacles: IR-SIM's, as they stand in the file.
        size_m: width and height.
    """

    path: Path
    dock: Point
    person_route: tuple[Point, ...]
    person_stays: Point
    kidnapped: Point
    obstacles: tuple[dict[str, Any], ...]
    size_m: Point


def load_world(path: Path) -> World:
    """Read a world; raises WorldError."""
    try:
        said = yaml.safe_load(path.read_text(encoding="utf-8"))
        return World(
            path=path,
            dock=_numbers(said["dock"], 3),
            person_route=tuple(_numbers(point, 2) for point in said["person"]["route"]),
            person_stays=_numbers(said["person"]["stays"], 2),
            kidnapped=_numbers(said["kidnapped"], 3),
            obstacles=tuple(said["irsim"]["obstacle"]),
            size_m=_numbers([said["irsim"]["world"]["width"], said["irsim"]["world"]["height"]], 2),
        )
    except OSError as error:
        raise WorldError(f"{path}: {error.strerror}; name a world's file") from error
    except KeyError as error:
        raise WorldError(f"{path}: {error} is missing; see worlds/office.yaml") from error
    except (yaml.YAMLError, TypeError, ValueError) as error:
        raise WorldError(f"{path}: {' '.join(str(error).split())}; see worlds/office.yaml") from error


def _numbers(value: Any, count: int) -> Point:
    numbers = tuple(float(number) for number in value)
    if len(numbers) != count or not all(map(math.isfinite, numbers)):
        raise ValueError(f"{value} should be {count} numbers")
    return numbers
