"""The drone's areas on the map, as ``robot.yaml`` names them: where its world's radio is good or bad."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

TONES = {"good": "good", "degraded": "fair"}
"""By a zone's quality; any other is bad."""


def radio_zones(world: Path) -> list[dict[str, Any]]:
    """Return the zones of a world file; raises ValueError where it is no YAML. What makes no sense in it the caller finds."""
    try:
        zones = yaml.safe_load(world.read_text(encoding="utf-8")).get("radio_zones") or []
    except yaml.YAMLError as error:  # its own words quote the file
        raise ValueError(f"{world.name} is no YAML: {getattr(error, 'problem', None) or 'its text is damaged'}") from error
    return [{**zone, "told": f"radio {zone['quality']}", "tone": TONES.get(zone["quality"], "bad")} for zone in zones]
