"""Nav2's nodes as its headers declare them, release by release (``nodes.xml``)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path

from alula.trees.document import Element, read_document
from alula.trees.library import DIRECTIONS, ignore, models_of, port_of
from alula.trees.node_type import NodeType
from alula.trees.ports import Port

RELEASES = ("humble", "jazzy", "kilted", "lyrical")
WRITTEN = (
    *("goal", "goals", "path", "initial_pose_received", "number_recoveries", "waypoint_statuses", "tracking_feedback"),
    *("server_timeout", "bt_loop_duration", "wait_for_service_timeout"),
)
"""Entries that Nav2's navigators write before a tree begins, by the names that their parameters have by default."""


@cache
def declared(release: str = "") -> Mapping[str, NodeType]:
    """Return what a release of Nav2 declares, by name; without one what any does, of the newest where they differ."""
    (models,) = read_document(Path(__file__).with_name("nodes.xml")).root.children
    pairs = zip(models.children, models_of(models, ignore), strict=True)
    return {known.name: _of(element, known, release) for element, known in pairs if _is_in(element, release)}


def _of(element: Element, known: NodeType, release: str) -> NodeType:
    ports = [_port(one) for one in element.children if one.tag in DIRECTIONS and _is_in(one, release)]
    return replace(known, ports={port.name: port for port in ports}, runs=element.get("runs") == "true", assumed=True)


def _port(element: Element) -> Port:
    optional, unchecked = (element.get(name) == "true" for name in ("optional", "unchecked"))
    return replace(port_of(element), optional=optional, unchecked=unchecked)


def _is_in(element: Element, release: str) -> bool:
    return not release or release in element.get("releases", " ".join(RELEASES)).split()
