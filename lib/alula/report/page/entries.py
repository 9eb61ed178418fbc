"""The input of the page: entries ``[topic, t_s, value]``, seconds of mission clock.

Without a time are facts of the whole run (``FACTS``), and what came before the mission clock was heard: a clock that was not heard
reads zero, and zero is no time of a run whose clock is Unix time.

Topics of the record (``alula.common.record``) keep their names and contents, with four exceptions. Of the tree the page gets the shape
once and then what changed, because a tree of 500 nodes is too much to be sent at each change; of the ticks those that changed what the
mission needs to start, met or not; of the reports none, because the events tell how executions go. Events and the mission's outcome get
what the page does not judge: older ones the kind of their result (``result_kind``), ends why they were (``why``), changes of resources
whether they are bad news (``alarm``, see ``alula.records.causes.alarms``), the mission its reason in words (``told``).
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Any

from alula.common.files import strict
from alula.common.record import DATA, EVENTS, MISSION, REPORTS, TICKS, TREE, Entry
from alula.records.causes.alarms import Alarms
from alula.records.causes.fault_file import alarms_of_robot
from alula.records.causes.wording import in_words, reason_in_words
from alula.records.kinds import with_kind
from alula.runtime.core.events import TRANSITION

RUN = "/run"
"""What was asked for: the values of ``run.json``, the ``name`` of its folder, and the robot's ``words`` (`read_page`)."""
ROUTE = "/route"
"""The waypoints that the mission means to reach: ``[[x, y, z], ...]``, frame map, metres."""
AREAS = "/areas"
"""Areas of the map, see ``areas.areas_of``."""
MAP = "/map"
"""Points of the map, see ``clouds.packed``."""
WORLD = "/world"
"""Edges of the true surfaces: ``[[x, y, z, x, y, z], ...]``, frame map, metres."""
PARTS = "/parts"
"""Of a deployment that is up, which is shown as a run without a scenario: ``{parts, master: {uri, problem, ahead_s, within_s}, disk}``.
A part is ``{name, state, deaths, why}``."""
SUMMARY = "/summary"
"""The values of ``summary.json`` but for its ``causes``."""
PATH = "/path"
"""Where the robot was: ``[x, y, z]``, frame map, metres."""
FAULT = "/fault"
"""Something was made to fail: ``{sensor, mode}``."""
HEALTH = "/health"
"""A watch changed its mind about a sensor: ``{sensor, ok, fault, reason}``."""
TOLD = "/told"
"""What a part of the robot told a person, as an autopilot's texts: ``{words}``."""
CAUSES = "/causes"
"""Faults, failures with their chains of causes, and what the mission did about them, see ``causes.Causes``."""
FACTS = frozenset({RUN, ROUTE, AREAS, MAP, WORLD, SUMMARY, CAUSES, PARTS})
"""Topics of which the last entry counts."""
NODES = "/nodes"
"""Nodes of the tree that changed: ``[[index, status, message], ...]``; index as in the last tree."""
TICKED = "/ticked"
"""A tick of a tree without a robot: ``{number, root, text}``."""

PICTURE = "/picture"
"""A small picture of a camera: ``{camera, jpeg}``, base64; what each shows, the robot's ``page`` says."""

OF_RECORDINGS = frozenset({PATH, WORLD, FAULT, HEALTH, TOLD})
"""Topics of what a report tells of the run's other recordings than the record."""

Wire = tuple[str, float | None, object]
"""An entry as the page gets it."""

Shape = tuple[int, str, str, str, str, str]
"""Of a node of the tree: depth, kind, name, skill; of a mission that is a file also type, ports and conditions as a text, and its place."""

DATA_PERIOD_S = 0.2
"""Samples of one data are thinned to this."""


def written(entry: Wire) -> str:
    """Return an entry as JSON; what JSON does not have (NaN, infinities) becomes null."""
    try:
        return json.dumps(entry, allow_nan=False, separators=(",", ":"))
    except ValueError:  # next to none has such numbers, and looking for them takes as long as writing
        return json.dumps(strict(list(entry)), allow_nan=False, separators=(",", ":"))


class Converter:
    """Turns the entries of a record into those of the page."""

    def __init__(self) -> None:
        self._shape: list[Shape] = []
        self._nodes: list[tuple[str, str]] = []
        self._sampled_s: dict[tuple[object, object], float] = {}
        self._start: object = None
        self._alarms: Alarms | None = None
        self._route: list[list[float]] | None = None

    def convert(self, entry: Entry) -> Iterator[Wire]:
        """Yield the page's entries for an entry of the record."""
        t_s = round(entry.stamp_s, 3) if entry.stamp_ns > 0 else None
        if entry.topic == TREE:
            yield from self._tree(t_s, entry.value)
        elif entry.topic == MISSION and self._route is None and (route := route_of(entry.value)):
            self._route = route
            yield ROUTE, None, route
            yield entry.topic, t_s, self._explained(entry)
        elif self._wanted(t_s, entry):
            yield entry.topic, t_s, self._explained(entry)

    def _explained(self, entry: Entry) -> Mapping[str, Any]:
        """Return an entry's value with what the page can't know: how an execution ended, and why, and which states are bad news."""
        value = entry.value
        if entry.topic == MISSION:
            return {**value, "told": reason_in_words(str(value.get("reason") or ""))}
        if entry.topic != EVENTS:
            return value
        if value.get("kind") == TRANSITION:
            self._alarms = self._alarms or alarms_of_robot()
            alarm = self._alarms.of(f"{value.get('skillset')}.{value.get('resource')}", str(value.get("to_state")))
            return {**value, "alarm": alarm.value}
        name, message = str(value.get("result") or ""), str(value.get("message") or "")
        return {**with_kind(value), "why": in_words(message.removeprefix(f"{name}: "))}

    def _wanted(self, t_s: float | None, entry: Entry) -> bool:
        if entry.topic == TICKS:
            before, self._start = self._start, (entry.value.get("unmet"), entry.value.get("conditions"))
            return before != self._start
        return entry.topic != REPORTS and (entry.topic != DATA or self._due(t_s, entry.value))

    def _due(self, t_s: float | None, sample: Mapping[str, Any]) -> bool:
        if t_s is None:
            return True
        key = (sample.get("skillset"), sample.get("data"))
        last_s = self._sampled_s.get(key)
        if last_s is not None and 0.0 <= t_s - last_s < DATA_PERIOD_S - 1e-6:
            return False
        self._sampled_s[key] = t_s
        return True

    def _tree(self, t_s: float | None, view: Mapping[str, Any]) -> Iterator[Wire]:
        shape: list[Shape] = []
        nodes: list[tuple[str, str]] = []
        _flatten(view, 0, shape, nodes)
        if shape != self._shape:
            self._shape, self._nodes = shape, [("INVALID", "")] * len(shape)
            yield TREE, t_s, shape
        changed = [[index, *node] for index, (node, before) in enumerate(zip(nodes, self._nodes, strict=True)) if node != before]
        self._nodes = nodes
        if changed:
            yield NODES, t_s, changed


def route_of(mission: Mapping[str, Any]) -> list[list[float]]:
    """Return the waypoints among a mission's inputs, frame map, metres; empty where it has none."""
    inputs = mission.get("inputs")
    try:
        listed = inputs.get("route", ()) if isinstance(inputs, Mapping) else ()
        return [[float(number) for number in (x, y, z)] for x, y, z in listed]
    except (TypeError, ValueError):
        return []


def _source(view: Mapping[str, Any]) -> str:
    """Return what a mission's file says of a node: its type, ports and conditions; empty for a node of no file."""
    parts = [_word(view.get("type"))]
    for key, sign in (("ports", "="), ("conditions", ": ")):
        texts = view.get(key)
        parts += [f"{name}{sign}{_word(text)}" for name, text in texts.items()] if isinstance(texts, Mapping) else []
    return "  ".join(filter(None, parts))


def _flatten(view: Mapping[str, Any], depth: int, shape: list[Shape], nodes: list[tuple[str, str]]) -> None:
    """Add of each node, top to bottom, its shape, and (status, message)."""
    get = view.get
    shape.append((depth, _word(get("kind")), _word(get("name")), _word(get("skill")), _source(view), _word(get("place"))))
    nodes.append((_word(get("status")) or "INVALID", _word(get("message"))))
    children = get("children")
    for child in children if isinstance(children, list | tuple) else ():
        if isinstance(child, Mapping):
            _flatten(child, depth + 1, shape, nodes)


def _word(value: object) -> str:
    return value if isinstance(value, str) else str(value or "")
