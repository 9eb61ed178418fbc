"""What a part of a deployment was started with, piece by piece, so that a later start can say what has changed."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import yaml

from alula.common.deployments import Deployment, makes_hooks
from alula.common.robots import RobotFolder
from alula.language.fleet import load_models
from alula.language.robot import Robot
from alula.model.json_form import to_json
from alula.model.model import Skillset
from alula_flight.station.parts import Part, Places, bridge_file

PIECES = {
    "data": "data",
    "resources": "resource",
    "events": "event",
    "skills": "skill",
    "properties": "property",
    "parameters": "parameter",
}
"""The lists of a model, and what one of each is called."""
ROUTES = {"topics": "topic", "services": "service", "actions": "action"}
"""Those of a bridge's configuration."""
Contents = Mapping[str, str]
"""Digests by what they are of, as ``skill drive``."""


def with_contents(parts: Sequence[Part], deployment: Deployment, places: Places, robot: RobotFolder) -> list[Part]:
    """Return the parts with what they would be started with now; raises AlulaError where a model is wrong."""
    models = load_models(robot) if deployment.managers else None
    found = []
    for part in parts:
        pieces: dict[str, object] = {}
        if part.name == "bridge":
            pieces.update(_of_bridge(bridge_file(deployment, places)))
        if models is not None:
            for name in deployment.served.get(part.name, ()):
                pieces.update(_of_managers(name, deployment.managers[name], models, robot))
        found.append(replace(part, contents={name: digest(value) for name, value in pieces.items()}))
    return found


def changes(before: Contents, now: Contents) -> list[str]:
    """Say what has changed: names of what is new, gone or another."""
    told = {
        "new": [name for name in now if name not in before],
        "gone": [name for name in before if name not in now],
        "changed": [name for name in now if name in before and before[name] != now[name]],
    }
    return [f"{how}: {', '.join(names)}" for how, names in told.items() if names]


def digest(value: object) -> str:
    """Return a short digest of plain values."""
    return hashlib.sha256(json.dumps(value, sort_keys=True, default=str).encode()).hexdigest()[:16]


def _of_bridge(path: Path) -> Iterator[tuple[str, object]]:
    document = yaml.safe_load(path.read_text(encoding="utf-8")) or {}
    for section, what in ROUTES.items():
        for route in document.get(section) or ():
            yield f"{what} {route.get('name')}", route
    yield "options", {key: value for key, value in document.items() if key not in ROUTES}


def _of_managers(name: str, words: Sequence[str], models: Robot, robot: RobotFolder) -> Iterator[tuple[str, object]]:
    skillset = next((one for one in models.skillsets if one.name == name), None)
    if skillset is not None:
        yield from ((f"{what} of {name}", piece) for what, piece in _of_model(skillset))
    for (owner, data), source in models.bindings.data.items():
        if owner == name:
            yield f"binding of {name}.{data}", str(source)
    module = words[0].partition(":")[0] if makes_hooks(words) else words[words.index("-m") + 1] if "-m" in words[:-1] else ""
    package = module.partition(".")[0]
    for path in sorted(robot.root.glob(f"ros2_ws/src/*/{package}/**/*.py")) if package else ():
        yield str(path.relative_to(robot.root)), path.read_text(encoding="utf-8", errors="replace")


def _of_model(skillset: Skillset) -> Iterator[tuple[str, object]]:
    model = json.loads(to_json(skillset))
    for section, what in PIECES.items():
        for one in model.pop(section):
            yield f"{what} {one['name']}", one
    yield "types", model
