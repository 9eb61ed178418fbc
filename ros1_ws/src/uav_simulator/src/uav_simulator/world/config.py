"""Read a world's description (``config/yard.yaml``); frame map: ENU, metres."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import yaml

from uav_simulator.errors import ConfigError
from uav_simulator.frames import Vec3

OBSTACLE_KINDS = ("pillar", "tree", "crate", "container")


@dataclass(frozen=True)
class Box:
    """An axis-aligned box that is the same for every seed."""

    name: str
    low: Vec3
    high: Vec3


@dataclass(frozen=True)
class Obstacle:
    """A thing whose details vary with the seed."""

    kind: str
    at: tuple[float, float]
    turn_deg: float = 0.0


@dataclass(frozen=True)
class Ground:
    """The extent of the flat ground at z = 0."""

    x: tuple[float, float]
    y: tuple[float, float]


@dataclass(frozen=True)
class WorldConfig:
    """A world and the route through it."""

    name: str
    home: Vec3
    route: tuple[Vec3, ...]
    keep_clear_m: float
    ground: Ground
    boxes: tuple[Box, ...]
    obstacles: tuple[Obstacle, ...]


def _numbers(value: Any, count: int, where: str) -> tuple[float, ...]:
    if not isinstance(value, list) or len(value) != count or not all(isinstance(v, int | float) for v in value):
        raise ConfigError(f"{where}: {value!r} is not a list of {count} numbers")
    return tuple(float(v) for v in value)


def _checked(data: Any, cls: type[Any], where: str) -> dict[str, Any]:
    """Return the mapping after checking that it has no key that ``cls`` does not know."""
    if not isinstance(data, dict):
        raise ConfigError(f"{where}: a mapping is expected, not {data!r}")
    known = {f.name for f in fields(cls)}
    unknown = sorted(set(data) - known)
    if unknown:
        raise ConfigError(f"{where}: unknown key {unknown[0]!r}; known are {', '.join(sorted(known))}")
    return data


def _vec3(value: Any, where: str) -> Vec3:
    x, y, z = _numbers(value, 3, where)
    return x, y, z


def _vec2(value: Any, where: str) -> tuple[float, float]:
    x, y = _numbers(value, 2, where)
    return x, y


def _box(data: Any, where: str) -> Box:
    data = _checked(data, Box, where)
    box = Box(str(data["name"]), _vec3(data["low"], f"{where}.low"), _vec3(data["high"], f"{where}.high"))
    if any(low >= high for low, high in zip(box.low, box.high, strict=True)):
        raise ConfigError(f"{where}: `low` must be below `high` on every axis in box {box.name!r}")
    return box


def _obstacle(data: Any, where: str) -> Obstacle:
    data = _checked(data, Obstacle, where)
    if data["kind"] not in OBSTACLE_KINDS:
        raise ConfigError(f"{where}: unknown kind {data['kind']!r}; known are {', '.join(OBSTACLE_KINDS)}")
    return Obstacle(data["kind"], _vec2(data["at"], f"{where}.at"), float(data.get("turn_deg", 0.0)))


def world_config_from_dict(data: Any, where: str) -> WorldConfig:
    """Check a parsed description; raises ConfigError naming the place."""
    data = _checked(data, WorldConfig, where)
    try:
        ground = _checked(data["ground"], Ground, f"{where}.ground")
        config = WorldConfig(
            name=str(data["name"]),
            home=_vec3(data["home"], f"{where}.home"),
            route=tuple(_vec3(p, f"{where}.route[{i}]") for i, p in enumerate(data["route"])),
            keep_clear_m=float(data["keep_clear_m"]),
            ground=Ground(_vec2(ground["x"], f"{where}.ground.x"), _vec2(ground["y"], f"{where}.ground.y")),
            boxes=tuple(_box(b, f"{where}.boxes[{i}]") for i, b in enumerate(data["boxes"])),
            obstacles=tuple(_obstacle(o, f"{where}.obstacles[{i}]") for i, o in enumerate(data["obstacles"])),
        )
    except KeyError as error:
        raise ConfigError(f"{where}: key {error.args[0]!r} is missing") from error
    if len(config.route) < 2:
        raise ConfigError(f"{where}.route: at least two points are needed")
    return config


def load_world_config(path: Path) -> WorldConfig:
    """Read and check a description; raises ConfigError naming file and place."""
    try:
        data = yaml.safe_load(path.read_text())
    except OSError as error:
        raise ConfigError(f"{path}: can't be read: {error.strerror}") from error
    except yaml.YAMLError as error:
        raise ConfigError(f"{path}: is no YAML: {error}") from error
    return world_config_from_dict(data, str(path))
