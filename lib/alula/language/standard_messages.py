"""Names of the messages that each ROS brings along: what is none of them is found where no ROS is installed, too."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path

import yaml


@cache
def standard_messages() -> Mapping[str, frozenset[str]]:
    """Return the names of the standard messages of ROS 1 and ROS 2, by package."""
    text = Path(__file__).with_suffix(".yaml").read_text(encoding="utf-8")
    return {package: frozenset(names.split()) for package, names in yaml.safe_load(text).items()}
