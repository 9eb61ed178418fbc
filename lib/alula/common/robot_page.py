"""What a robot says of its pages and reports: ``page`` in its ``robot.yaml`` (docs/reference/robots.md)."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from typing import Any

from alula.common.keys import Key
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
KEYS: Mapping[str, Key] = {
    "departure": Key("the word for the departure", WORDS["departure"]),
    "away": Key("for being away", WORDS["away"]),
    "back": Key("for having come back", WORDS["back"]),
    "moved": Key("for the way covered", WORDS["moved"]),
    "stop": Key("for the act that ends a mission", WORDS["stop"]),
    "controller": Key("for what else commands", WORDS["controller"]),
    "tasks": Key("for what a mission is sent out for", WORDS["tasks"]),
    "live": Key("what a live run is on, `default` and by option that is set"),
    "modes": Key("those of the controller in which the mission does not command, and what the robot does in them"),
    "glossary": Key("words of its field, explained"),
    "mode": Key("`skillset.data.field`: the controller's mode"),
    "link": Key("`skillset.data.field`: whether the controller is connected"),
    "links": Key("resources that are links"),
    "charts": Key("`skillset.data.field`: what is drawn first"),
    CAMERAS: Key("by name: `about`, what it shows; with `data` the `figures` below its picture, by field"),
    FIGURES: Key(
        f"by path in `summary.json`: {', '.join(f'`{key}`' for key in FIGURE_KEYS)} (by which it is multiplied; 100 of a unit that begins "
        "with %); on the page, in a run's last lines and in `compare`, after those of every robot"
    ),
    FENCE: Key("[radius, floor, ceiling] in m: the upright cylinder around home that it stays in"),
    FLAT: Key("true: it moves on a floor. No heights are reported or drawn, and the map is the whole floor"),
}
"""What the manual says of each key (docs/reference/robots.md)."""


def read_page(part: Located | None) -> dict[str, Any]:
    """Return what the page and the reports say and show of a robot, as JSON has it.

    ``fence`` is ``{radius_m, z: [floor, ceiling]}``, metres; ``mode``, ``link`` and ``fence`` are None where there are none.
    """
    said = {} if part is None else part.record("`page`", KEYS)
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
    return {key: readers[key][1](said[key]) if key in said else readers[key][0] for key in KEYS}


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
