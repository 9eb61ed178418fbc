"""What a robot says of its pages and reports: ``page`` in its ``robot.yaml`` (docs/reference/robots.md)."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from typing import Any

from alula.common.located_yaml import Located

Read = Callable[[Located], Any]

WORDS = {
    "departure": "departure",
    "away": "under way",
    "back": "back",
    "moved": "travelled",
    "stop": "stop",
    "controller": "controller",
    "tasks": "tasks",
}
"""What pages call the departure, being away, having come back, the way covered, the act that ends a mission, what else commands, and what
the mission was sent out for."""
TABLES = ("live", "modes", "glossary")
FIELDS = ("mode", "link")
LISTS = ("links", "charts")
CAMERAS, FIGURES, FENCE, FLAT = "cameras", "figures", "fence", "flat"
FIGURE_KEYS = ("label", "unit", "digits", "factor")


def read_page(part: Located | None) -> dict[str, Any]:
    """Return what the page and the reports say and show of a robot, as JSON has it.

    ``live`` says what a live run is on: of each option of the run that is set, and under ``default``. ``modes`` are those in which the
    mission does not command, and what the robot does in them; ``glossary`` explains words of the robot's field. ``mode`` and ``link`` are
    the fields of data with the controller's mode and whether it is heard of, None where there is none; ``links`` are resources that are
    links, ``charts`` fields of data that are drawn first. ``cameras`` say what each shows, ``figures`` what numbers of ``summary.json``
    are called besides those of every robot, by their path. ``fence``: ``{radius_m, z: [floor, ceiling]}``, metres, None: there is none.
    ``flat``: it moves on a floor, so nothing is told or drawn of heights, and its map is the whole of what stands on that floor.
    """
    said = {} if part is None else part.record("`page`", (*WORDS, *TABLES, *FIELDS, *LISTS, CAMERAS, FIGURES, FENCE, FLAT))
    readers: Mapping[str, tuple[Any, Read]] = {
        **{key: (usual, functools.partial(_text, key)) for key, usual in WORDS.items()},
        **{key: ({}, functools.partial(_table, key, functools.partial(_text, key))) for key in TABLES},
        **{key: (None, functools.partial(_text, key)) for key in FIELDS},
        **{key: ([], functools.partial(_texts, key)) for key in LISTS},
        CAMERAS: ({}, functools.partial(_table, CAMERAS, _camera)),
        FIGURES: ({}, functools.partial(_table, FIGURES, _figure)),
        FENCE: (None, _fence),
        FLAT: (False, _flat),
    }
    return {key: read(said[key]) if key in said else usual for key, (usual, read) in readers.items()}


def _text(key: str, part: Located) -> str:
    return part.text(f"`{key}`")


def _texts(key: str, part: Located) -> list[str]:
    return [entry.text(f"an entry of `{key}`") for entry in part.elements()]


def _table(key: str, read: Read, part: Located) -> dict[str, Any]:
    return {name: read(entry) for name, entry in part.entries(f"`{key}`").items()}


def _camera(part: Located) -> dict[str, Any]:
    """Read what a camera shows, and the figures of data that stand below its picture."""
    said = part.record("a camera", ("about", "data", FIGURES))
    if "about" not in said:
        raise part.wrong("a camera needs `about`, what it shows")
    figures = said[FIGURES].entries("`figures` of a camera") if FIGURES in said else {}
    return {
        "about": said["about"].text("`about`"),
        "data": said["data"].text("`data`") if "data" in said else "",
        FIGURES: {name: _figure(one) for name, one in figures.items()},
    }


def _figure(part: Located) -> dict[str, Any]:
    """Read how a number is told: ``{label, unit, digits}``; the number is multiplied by ``factor``, 100 for ``%``."""
    said = part.record("a figure", FIGURE_KEYS)
    if "label" not in said:
        raise part.wrong("a figure needs `label`, what it is called")
    unit = said["unit"].text("`unit`") if "unit" in said else ""
    usual = 100.0 if unit.startswith("%") else 1.0
    return {
        "label": said["label"].text("`label`"),
        "unit": unit,
        "digits": int(said["digits"].number("`digits`", 0, 9)) if "digits" in said else 1,
        "factor": said["factor"].number("`factor`", 0) if "factor" in said else usual,
    }


def _flat(part: Located) -> bool:
    if not isinstance(part.value, bool):
        raise part.wrong("`flat` should be true or false")
    return part.value


def _fence(part: Located) -> dict[str, Any]:
    numbers = [one.number("a number of `fence`", -1e6) for one in part.elements()]
    if len(numbers) != 3:
        raise part.wrong("`fence` should be [radius, floor, ceiling] in metres")
    return {"radius_m": numbers[0], "z": numbers[1:]}


USUAL_PAGE: Mapping[str, Any] = read_page(None)
"""Of a robot that says nothing."""
