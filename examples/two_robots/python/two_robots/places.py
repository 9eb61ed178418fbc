"""Where they meet, read from the file of a world."""

from __future__ import annotations

from pathlib import Path

import yaml

from alula.missions.plan import InputError, Inputs


def inputs_of(path: Path) -> Inputs:
    """Read one place in the maps of both: ``landing`` [x, y, z] of the drone, ``pickup`` {x, y, theta} of the rover; raises InputError."""
    try:
        said = yaml.safe_load(path.read_text(encoding="utf-8"))
        x, y, theta = map(float, said["rover"])
        landing = [float(number) for number in said["drone"]]
    except (OSError, yaml.YAMLError, KeyError, TypeError, ValueError) as error:
        raise InputError(f"{path}: needs `drone: [x, y, z]` and `rover: [x, y, theta]`: {' '.join(str(error).split())}") from error
    return {"landing": landing, "pickup": {"x": x, "y": y, "theta": theta}}
