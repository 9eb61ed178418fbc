"""Where the rover works: rooms, the ways into them and the doors on these, read from the file of a world."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml
from alula import parts

Pose = dict[str, float]
"""``x``, ``y`` (m) and ``theta`` (rad) in the frame ``map``: a geometry_msgs/Pose2D."""


def inputs_of(path: Path) -> parts.Inputs:
    """Read what the missions are given from a world: ``parcels`` with the rooms of both ends, ``rounds``, all doors of the ``house``.

    A room is ``{name, inside, ways}``, a way a list of doors ``{door, at, safe}``; all poses as `Pose`.

    Raises:
        InputError: the file can't be read, or lacks something; the message says what.
    """
    try:
        said = yaml.safe_load(path.read_text(encoding="utf-8"))
        house = House(said)
        parcels = [{"name": f"{p['from']}-{p['to']}", "from": house.room(p["from"]), "to": house.room(p["to"])} for p in said["parcels"]]
        rounds = [house.place(name) for name in said["rounds"]]
        return {"parcels": parcels, "rounds": rounds, "safe": rounds[-1], "house": house.doors()}
    except OSError as error:
        raise parts.InputError(f"{path}: {error.strerror}") from error
    except KeyError as error:
        raise parts.InputError(f"{path}: there is no {error}; worlds/office.yaml has all that a world needs") from error
    except (yaml.YAMLError, TypeError, ValueError) as error:
        raise parts.InputError(f"{path}: {' '.join(str(error).split())}") from error


class House:
    """The places, doors and ways of a world."""

    def __init__(self, said: Mapping[str, Any]) -> None:
        self._places, self._doors, self._ways = said["places"], said["doors"], said["ways"]

    def place(self, name: str) -> Pose:
        """Return the pose of a place; raises KeyError, ValueError."""
        return pose(self._places[name])

    def room(self, name: str) -> dict[str, Any]:
        """Return a room with its ways; raises KeyError, ValueError."""
        return {"name": name, "inside": self.place(name), "ways": [[self._door(door) for door in way] for way in self._ways[name]]}

    def doors(self) -> list[dict[str, Any]]:
        """Return every door once; raises KeyError, ValueError."""
        return list({door["door"]: door for door in map(self._door, self._doors)}.values())

    def _door(self, name: str) -> dict[str, Any]:
        said = self._doors[name]
        return {"door": said.get("door", name), "at": pose(said["at"]), "safe": self.place(said["safe"])}


def pose(numbers: object) -> Pose:
    """Return ``[x, y, theta]`` by name; raises ValueError."""
    if not isinstance(numbers, list) or len(numbers) != 3 or not all(isinstance(n, int | float) and math.isfinite(n) for n in numbers):
        raise ValueError(f"{numbers!r} is not [x, y, theta] in metres and radians")
    return dict(zip(("x", "y", "theta"), map(float, numbers), strict=True))
