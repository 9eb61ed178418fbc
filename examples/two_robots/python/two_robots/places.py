"""Where they meet: read from the file of a world, and brought from the map of the one into that of the other."""

from __future__ import annotations

import math
from pathlib import Path

import yaml

from alula.missions.part import MissionPart
from alula.missions.plan import InputError, Inputs
from alula.trees.errors import TickError
from alula.trees.node import SyncAction, Wiring
from alula.trees.palette import Port, input_port, output_port
from alula.trees.status import FAILURE, SUCCESS, Answer
from alula.trees.values import ANY, STRING


def inputs_of(path: Path) -> Inputs:
    """Read ``landing``, [x, y, z] in the drone's map, and ``T_rover_drone``, {x, y, theta}; raises InputError."""
    try:
        said = yaml.safe_load(path.read_text(encoding="utf-8"))
        landing = _numbers(said["drone"])
        x, y, theta = _numbers(said["maps"])
    except (OSError, yaml.YAMLError, KeyError, TypeError, ValueError) as error:
        raise InputError(f"{path}: needs `drone: [x, y, z]` and `maps: [x, y, theta]`: {' '.join(str(error).split())}") from error
    return {"landing": landing, "T_rover_drone": {"x": x, "y": y, "theta": theta}}


def _numbers(said: object) -> list[float]:
    if not isinstance(said, list) or len(said) != 3:
        raise ValueError(f"{said!r} is not three numbers")
    return [float(number) for number in said]


class InRoversMap(SyncAction):
    """Brings a place from the drone's map into the rover's, as a pose there that is turned as the maps are; fails while it is not known."""

    ports: tuple[Port, ...] = (
        input_port("x", STRING, doc="a script that says it, in metres"),
        input_port("y", STRING, doc="a script that says it, in metres"),
        input_port("T_rover_drone", ANY, doc="where the drone's map lies in the rover's: x, y, theta"),
        output_port("target", ANY, doc="x, y, theta in the rover's map"),
    )

    def __init__(self, wiring: Wiring) -> None:
        super().__init__(wiring)
        self._place = [wiring.compile(wiring.ports[port], port) for port in ("x", "y")]

    def update(self) -> Answer:
        """Write it."""
        x, y = (script.run() for script in self._place)
        if not isinstance(x, float | int) or not isinstance(y, float | int):
            self.feedback_message = str(x)
            return FAILURE
        transform = self.get("T_rover_drone")
        if not isinstance(transform, dict):
            raise TickError(f"{self.place()}: T_rover_drone is no pose")
        theta = float(transform["theta"])
        target = {
            "x": transform["x"] + x * math.cos(theta) - y * math.sin(theta),
            "y": transform["y"] + x * math.sin(theta) + y * math.cos(theta),
            "theta": theta,
        }
        self.put("target", target)
        self.feedback_message = f"({x:.2f}, {y:.2f}) of the drone is ({target['x']:.2f}, {target['y']:.2f}) of the rover"
        return SUCCESS


PART = MissionPart((("two_robots.InRoversMap", InRoversMap),))
