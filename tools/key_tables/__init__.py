"""Writes the tables of keys of files, messages and topics on the manual's pages, from the code that has them.

PYTHONPATH=tools setup/in_ros2 python -m key_tables
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path

from alula.campaign import plan
from alula.common import deployments, record, robot_page, robots, scenarios
from alula.common.generated import key_table, replaced, table
from alula.common.keys import Key
from alula.mock import reading as mocks
from key_tables.interfaces import definitions, examples, nodes, rooms, settings, topics
from ros_bridge import config_file, discovery_options

ALULA_ROOT = Path(__file__).resolve().parents[2]
COMMAND = "PYTHONPATH=tools setup/in_ros2 python -m key_tables"


def pages() -> Iterator[tuple[Path, str]]:
    """Yield each page with its text as it should be."""
    for name, lines in PAGES.items():
        path = ALULA_ROOT / name
        yield path, replaced(path.read_text(encoding="utf-8"), COMMAND, "the code that reads the file", lines())


def _robot() -> Iterator[str]:
    yield from ("## `robot.yaml`", "", *key_table(robots.KEYS), "", "Of `ros1` and `ros2`:", "", *key_table(robots.WORLD_KEYS), "")
    parts = ((f"`{name}`", text) for name, text in robots.PARTS.items())
    yield from ("## What a robot adds", "", *table(("part", "what it names"), *parts), "")
    yield from ("## Page", "", "Of `page`; the drone's `robot.yaml` uses all of it.", "", *key_table(robot_page.KEYS))


def _deployment() -> Iterator[str]:
    parts = {
        "ros1": deployments.ROS1_KEYS,
        "ros2": deployments.ROS2_KEYS,
        "record": deployments.RECORD_KEYS,
        "page": deployments.PAGE_KEYS,
    }
    flat: dict[str, Key] = {}
    for name, own in deployments.KEYS.items():
        flat |= {name: own, **{f"{name}: {key}": text for key, text in parts.get(name, {}).items()}}
    yield from ("## Keys of the file", "", *key_table(flat))


def _bridge() -> Iterator[str]:
    routes = {key: config_file.KEYS[key] for key in (*config_file.NAMES, *config_file.TOPIC_KEYS, *config_file.SERVICE_KEYS)}
    yield from ("## Keys of a route", "", *key_table(routes), "")
    options = ((f"`{name}`", option.help) for name, option in discovery_options.OPTIONS.items())
    yield from ("## Keys of `discover`", "", *table(("key", "what it does"), *options))


def _scenario() -> Iterator[str]:
    yield from ("## Keys of a scenario", "", *key_table(scenarios.KEYS))


def _campaign() -> Iterator[str]:
    yield from ("## Keys of a campaign", "", *key_table(plan.KEYS), "", "Of `draw`:", "", *key_table(plan.DRAW))


def _mock() -> Iterator[str]:
    yield from ("## Keys of a rule", "", *key_table(mocks.RULE))


def _record() -> Iterator[str]:
    yield from ("## Topics of `skills.mcap`", "", *topics(record))


def _skillset_interfaces() -> Iterator[str]:
    yield from ("## Messages of a skillset", "", "Of `skillset_interfaces`.", "")
    yield from definitions(ALULA_ROOT / "bridge/interfaces/skillset_interfaces")


def _drone() -> Iterator[str]:
    yield from ("## Messages of the drone", "", "Of `uav_msgs`.", "", *definitions(ALULA_ROOT / "bridge/interfaces/uav_msgs"))


def _nodes() -> Iterator[str]:
    yield from ("## Alula's nodes", "", *nodes())


def _rooms() -> Iterator[str]:
    yield from ("## Rooms of the library", "", *rooms(ALULA_ROOT / "tests/test_rooms.py", ALULA_ROOT / "lib/alula"))


def _examples() -> Iterator[str]:
    yield from ("## Files that show one thing", "", *examples(ALULA_ROOT / "examples"))


def _dead_man() -> Iterator[str]:
    kinds = ("ZeroSettings", "CancelSettings", "ServiceSettings", "ScriptSettings", "ReportSettings")
    yield from ("## Calls and report", "", *settings(ALULA_ROOT / "ros1_ws/src/alula_base/src/alula_base/settings.py", kinds))


PAGES: Mapping[str, Callable[[], Iterable[str]]] = {
    "docs/reference/robots.md": _robot,
    "docs/how-to/on-the-robot.md": _deployment,
    "docs/reference/bridge.md": _bridge,
    "docs/how-to/scenarios.md": _scenario,
    "docs/how-to/campaigns.md": _campaign,
    "docs/reference/mocks.md": _mock,
    "docs/reference/records.md": _record,
    "docs/reference/names.md": _skillset_interfaces,
    "docs/reference/drone.md": _drone,
    "docs/reference/mission-files.md": _nodes,
    "docs/concepts/architecture.md": _rooms,
    "examples/README.md": _examples,
    "ros1_ws/src/alula_base/README.md": _dead_man,
}
