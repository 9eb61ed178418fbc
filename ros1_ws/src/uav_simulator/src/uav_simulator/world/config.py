"""Read a world file: what stands in the world, the route through it, and where the radio is bad. Frame map: ENU, metres.

The format is described in the package's README. Every complaint names file and line.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path

from alula.common.located_yaml import Located, choices, read_yaml
from uav_simulator.errors import ConfigError
from uav_simulator.frames import Vec3
from uav_simulator.world.radio import BoxVolume, CylinderVolume, RadioQuality, RadioZone, SphereVolume, Volume

WORLDS = Path(__file__).resolve().parents[3] / "worlds"
OBSTACLE_KINDS = ("pillar", "tree", "crate", "container")
KEYS = ("name", "home", "route", "keep_clear_m", "ground", "boxes", "obstacles", "scatter", "radio_zones")
FAR_M = 1000.0  # no coordinate of a world is farther from the origin
MAX_SCATTERED = 500


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
class Scatter:
    """Things at places that vary with the seed, within a rectangle."""

    kind: str
    count: int
    x: tuple[float, float]
    y: tuple[float, float]


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
    boxes: tuple[Box, ...] = ()
    obstacles: tuple[Obstacle, ...] = ()
    scatter: tuple[Scatter, ...] = ()
    radio_zones: tuple[RadioZone, ...] = ()


def world_names() -> list[str]:
    """Return the names of the worlds that come with the simulator."""
    return sorted(path.stem for path in WORLDS.glob("*.yaml"))


def find_world(text: str) -> Path:
    """Return the file of a world that is given by its name or by its path; raises ConfigError when there is none."""
    named = WORLDS / f"{text}.yaml"
    path = Path(text).expanduser().absolute()
    if "/" not in text and named.is_file():
        return named
    if path.is_file():
        return path
    raise ConfigError(f"there is no world '{text}': give a file, or one of {choices(text, world_names())}")


def load_world(path: Path) -> WorldConfig:
    """Read and check a world file; raises ConfigError naming file and line."""
    document = read_yaml(path, ConfigError)
    if document is None:
        raise ConfigError(f"{path}: is empty; a world needs name, home, route, keep_clear_m and ground")
    said = document.record("a world", KEYS)
    ground = _required(document, said, "ground", "a world").record("`ground`", ("x", "y"))
    route = _list(_required(document, said, "route", "a world"), "`route`")
    if len(route) < 2:
        raise said["route"].wrong("`route` needs at least two points")
    return WorldConfig(
        name=_required(document, said, "name", "a world").text("`name`"),
        home=_point(_required(document, said, "home", "a world"), "`home`"),
        route=tuple(_point(part, "a point of the route") for part in route),
        keep_clear_m=_required(document, said, "keep_clear_m", "a world").number("`keep_clear_m`", 0.0, FAR_M),
        ground=Ground(*(_span(_required(said["ground"], ground, axis, "`ground`"), f"`{axis}` of the ground") for axis in ("x", "y"))),
        boxes=tuple(_box(part) for part in _section(said, "boxes")),
        obstacles=tuple(_obstacle(part) for part in _section(said, "obstacles")),
        scatter=tuple(_scatter(part) for part in _section(said, "scatter")),
        radio_zones=tuple(_zone(part) for part in _section(said, "radio_zones")),
    )


def _required(part: Located, said: Mapping[str, Located], key: str, what: str) -> Located:
    if key not in said:
        raise part.wrong(f"{what} needs `{key}`")
    return said[key]


def _list(part: Located, what: str) -> list[Located]:
    if not part.is_list:
        raise part.wrong(f"{what} should be a list")
    return part.elements()


def _section(said: Mapping[str, Located], key: str) -> list[Located]:
    return _list(said[key], f"`{key}`") if key in said else []


def _numbers(part: Located, what: str, count: int) -> list[float]:
    numbers = _list(part, what)
    if len(numbers) != count:
        raise part.wrong(f"{what} should have {count} numbers, not {len(numbers)}")
    return [number.number(f"a coordinate of {what}", -FAR_M, FAR_M) for number in numbers]


def _point(part: Located, what: str) -> Vec3:
    x, y, z = _numbers(part, what, 3)
    return x, y, z


def _place(part: Located, what: str) -> tuple[float, float]:
    x, y = _numbers(part, what, 2)
    return x, y


def _span(part: Located, what: str) -> tuple[float, float]:
    low, high = _place(part, what)
    if low >= high:
        raise part.wrong(f"{what}: {low:g} should be below {high:g}")
    return low, high


def _choice(part: Located, what: str, known: Collection[str]) -> str:
    word = part.text(what)
    if word not in known:
        raise part.wrong(f"{what} is `{word}`; it may be {choices(word, known)}")
    return word


def _corners(part: Located, said: Mapping[str, Located], what: str) -> tuple[Vec3, Vec3]:
    low, high = (_point(_required(part, said, key, what), f"`{key}`") for key in ("low", "high"))
    if any(a >= b for a, b in zip(low, high, strict=True)):
        raise part.wrong(f"{what}: `low` must be below `high` on every axis")
    return low, high


def _box(part: Located) -> Box:
    said = part.record("a box", ("name", "low", "high"))
    name = _required(part, said, "name", "a box").text("the name of a box")
    return Box(name, *_corners(part, said, f"box '{name}'"))


def _kind(part: Located, said: Mapping[str, Located], what: str) -> str:
    return _choice(_required(part, said, "kind", what), f"the kind of {what}", OBSTACLE_KINDS)


def _obstacle(part: Located) -> Obstacle:
    said = part.record("an obstacle", ("kind", "at", "turn_deg"))
    turn_deg = said["turn_deg"].number("`turn_deg`", -360.0, 360.0) if "turn_deg" in said else 0.0
    at = _place(_required(part, said, "at", "an obstacle"), "`at`")
    return Obstacle(_kind(part, said, "an obstacle"), at, turn_deg)


def _scatter(part: Located) -> Scatter:
    said = part.record("an entry of `scatter`", ("kind", "count", "x", "y"))
    x, y = (_span(_required(part, said, axis, "an entry of `scatter`"), f"`{axis}`") for axis in ("x", "y"))
    count = _required(part, said, "count", "an entry of `scatter`")
    number = count.number("`count`", 1, MAX_SCATTERED)
    if not number.is_integer():
        raise count.wrong(f"`count` should be a whole number, not {number:g}")
    return Scatter(_kind(part, said, "an entry of `scatter`"), int(number), x, y)


def _zone(part: Located) -> RadioZone:
    volumes = {"box": _box_volume, "cylinder": _cylinder_volume, "sphere": _sphere_volume}
    said = part.record("a radio zone", ("name", "quality", *volumes))
    given = [key for key in volumes if key in said]
    if len(given) != 1:
        raise part.wrong(f"a radio zone needs one of {', '.join(volumes)}; this one has {' and '.join(given) or 'none'}")
    quality = _choice(_required(part, said, "quality", "a radio zone"), "`quality`", [quality.value for quality in RadioQuality])
    name = _required(part, said, "name", "a radio zone").text("the name of a radio zone")
    return RadioZone(name, RadioQuality(quality), volumes[given[0]](said[given[0]]))


def _box_volume(part: Located) -> Volume:
    return BoxVolume(*_corners(part, part.record("`box`", ("low", "high")), "`box`"))


def _cylinder_volume(part: Located) -> Volume:
    said = part.record("`cylinder`", ("at", "radius_m", "z"))
    at = _place(_required(part, said, "at", "`cylinder`"), "`at`")
    z = _span(_required(part, said, "z", "`cylinder`"), "`z`")
    return CylinderVolume(at, _required(part, said, "radius_m", "`cylinder`").number("`radius_m`", 0.01, FAR_M), z)


def _sphere_volume(part: Located) -> Volume:
    said = part.record("`sphere`", ("at", "radius_m"))
    at = _point(_required(part, said, "at", "`sphere`"), "`at`")
    return SphereVolume(at, _required(part, said, "radius_m", "`sphere`").number("`radius_m`", 0.01, FAR_M))
