"""Writes the manual's page of the nodes' parameters: ``python -m uav_flight.parameter_page`` in the ROS 1 world."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING

from alula.common.files import write_text
from alula.common.generated import documented_fields, replaced, table
from lidar_mapping.settings import MappingSettings
from lidar_obstacles.settings import LidarSettings
from perception_core.tunable import ranges
from uav_guidance.settings import GuidanceSettings
from zed_depth.settings import ZedSettings

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

PAGE = Path(__file__).resolve().parents[5] / "docs/reference/drone-parameters.md"
NODES: Mapping[str, DataclassInstance] = {
    "uav_guidance": GuidanceSettings(),
    "zed_depth": ZedSettings(),
    "lidar_obstacles": LidarSettings(),
    "lidar_mapping": MappingSettings(),
}


def main() -> int:
    """Write the tables anew; return the exit code."""
    write_text(PAGE, page(PAGE.read_text(encoding="utf-8")))
    return 0


def page(text: str) -> str:
    """Return the page with its tables replaced."""
    return replaced(text, "setup/in_ros1 python -m uav_flight.parameter_page", "the nodes' settings", _tables())


def _tables() -> Iterator[str]:
    for name, settings in NODES.items():
        head = ("parameter", "default", "from", "to", "what it is")
        yield from (f"## /{name}", "", *table(head, *_rows(settings)), "")


def _rows(settings: DataclassInstance) -> Iterator[tuple[str, ...]]:
    """Yield a row for each parameter; what one with a range is, its range says, else the docstring below the field."""
    documented, known = dict(documented_fields(type(settings))), ranges(settings)
    for field in fields(settings):
        default = getattr(settings, field.name)
        if field.name not in known:
            yield f"`~{field.name}`", _number(default), "", "", documented[field.name]
            continue
        allowed = known[field.name]
        low, high = (False, True) if isinstance(default, bool) else (allowed.low, allowed.high)
        yield f"`~{field.name}`", _number(default), _number(low), _number(high), allowed.doc


def _number(value: object) -> str:
    """Return a value as people write it: 1000000, 0.0349, true."""
    if isinstance(value, bool):
        return str(value).lower()
    if not isinstance(value, float):
        return str(value)
    return f"{value:.0f}" if value.is_integer() else f"{value:.3g}"


if __name__ == "__main__":
    sys.exit(main())
