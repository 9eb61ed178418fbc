"""Where they meet: read from the file of a world, and brought from the map of the one into that of the other."""

from __future__ import annotations

import math
from pathlib import Path

import yaml

from alula import parts
from alula.trees import ANY, FAILURE, SUCCESS, Answer, Port, SyncAction, TickError, input_port, output_port, register, script_port


def inputs_of(path: Path) -> parts.Inputs:
    """Read ``landing``, [x, y, z] in the drone's map, and ``T_rover_drone``, {x, y, theta}; raises InputError."""
    try:
        said = yaml.safe_load(path.read_text(encoding="utf-8"))
        landing = _numbers(said["drone"])
        x, y, theta = _numbers(said["maps"])
    except (OSError, yaml.YAMLError, KeyError, TypeError, ValueError) as error:
        raise parts.InputError(f"{path}: needs `drone: [x, y, z]` and `maps: [x, y, theta]`: {' '.join(str(error).split())}") from error
    return {"landing": landing, "T_rover_drone": {"x": x, "y": y, "theta": theta}}


def _numbers(said: object) -> list[float]:
    if not isinstance(said, list) or len(said) != 3:
        raise ValueError(f"{said!r} is not three numbers")
    return [float(number) for number in said]


@register("two_robots.InRoversMap")
class InRoversMap(SyncAction):
    """Brings a place from the drone's map into the rover's, as a pose there that is turned as the maps are; fails while it is not known."""

    ports: tuple[Port, ...] = (
        script_port("x", "a script that says it, in metres"),
        script_port("y", "a script that says it, in metres"),
        input_port("T_rover_drone", ANY, doc="where the drone's map lies in the rover's: x, y, theta"),
        output_port("target", ANY, doc="x, y, theta in the rover's map"),
    )

    def setup(self) -> None:
        """Read the scripts."""
        self._place = [self.script(port) for port in ("x", "y")]

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


PART = parts.MissionPart((InRoversMap,))
