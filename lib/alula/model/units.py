"""Units that a condition may be written in; messages carry SI units (REP 103)."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping

UNIT_IN_SI: Mapping[str, float] = {
    "": 1.0,
    "m": 1.0,
    "km": 1000.0,
    "cm": 0.01,
    "mm": 0.001,
    "m/s": 1.0,
    "km/h": 1 / 3.6,
    "s": 1.0,
    "sec": 1.0,
    "ms": 0.001,
    "min": 60.0,
    "h": 3600.0,
    "rad": 1.0,
    "deg": math.pi / 180,
    "V": 1.0,
    "Hz": 1.0,
    "%": 0.01,
}
"""By what to multiply a number in a unit to have it in SI units."""

KIND_OF_UNIT: Mapping[str, str] = {
    **dict.fromkeys(("m", "km", "cm", "mm"), "a length"),
    **dict.fromkeys(("m/s", "km/h"), "a speed"),
    **dict.fromkeys(("s", "sec", "ms", "min", "h"), "a time"),
    **dict.fromkeys(("rad", "deg"), "an angle"),
    "V": "a voltage",
    "Hz": "a frequency",
    "%": "a part of a whole",
}
"""What a unit measures; one kind is never compared with another."""


def told_unit(comment: str) -> str:
    """Return the unit that a comment begins with, as `Hz` or `m/s, over the ground`; empty where it begins with none."""
    unit = re.split(r"[,;:]", comment, maxsplit=1)[0].strip()
    return unit if unit in KIND_OF_UNIT else ""
