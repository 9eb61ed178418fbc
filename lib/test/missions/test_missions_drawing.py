"""The tree as a picture: everything that is said is in it, legible and inside the frame."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import pytest

pytest.importorskip("py_trees")

from alula.missions.drawing import NOTE_LETTERS, draw
from alula.trees.view import NodeView

SVG = "{http://www.w3.org/2000/svg}"


def node(name, kind="action", status="SUCCESS", message="", skill="", *children):
    return NodeView(name, kind, status, message, skill, children)


def parsed(picture: str) -> ET.Element:
    return ET.fromstring(picture)  # noqa: S314 - our own


def texts(picture: str) -> list[str]:
    return ["".join(text.itertext()) for text in parsed(picture).iter(f"{SVG}text")]


def test_each_node_is_drawn_with_its_skill_and_how_it_ended():
    grip, rest = node("grip", "skill", "FAILURE", "arm.grip: DROPPED", "arm.grip"), node("rest", status="INVALID")
    tree = node("all", "sequence", "FAILURE", "", "", grip, rest)
    said = texts(draw(tree, "Mission <1>"))
    assert said[0] == "Mission <1>"
    assert {"→ all", "grip", "✗ arm.grip: DROPPED", "rest"} <= set(said)
    assert texts(draw(node("a", "skill", "SUCCESS", "", "arm.grip"), ""))[1] == "a (grip)"


def test_a_long_reason_is_cut_visibly_and_stays_whole_in_the_hint():
    reason = "because " * 60
    picture = draw(node("grip", "skill", "FAILURE", reason, "arm.grip"), "")
    (note,) = [text for text in texts(picture) if "because" in text]
    assert len(note) == NOTE_LETTERS
    assert note.endswith("…")
    (hint,) = [title.text for title in parsed(picture).iter(f"{SVG}title") if "because" in title.text]
    assert reason in hint


@pytest.mark.parametrize("depth", [1, 5, 40])
def test_nothing_is_drawn_outside(depth):
    tree = node("leaf", "condition", "FAILURE", "why " * 20)
    for level in range(depth):
        tree = node(f"level {level}", "sequence", "RUNNING", "", "", tree)
    root = parsed(draw(tree, "deep"))
    width, height = float(root.get("width")), float(root.get("height"))
    boxes = [box for box in root.iter(f"{SVG}rect") if box.get("x")]
    assert len(boxes) >= depth + 1
    assert all(float(box.get("x")) + float(box.get("width")) <= width for box in boxes)
    assert all(float(box.get("y")) + float(box.get("height")) <= height for box in boxes)
