"""Robots of random trees: whatever names, ports and nodes those have, the robot checks clean, generates, and runs over mocks."""

from __future__ import annotations

import tempfile
from pathlib import Path
from xml.sax.saxutils import quoteattr

from adopt_folders import mains_of
from hypothesis import given, settings
from hypothesis import strategies as st

from alula import Mission, Outcome, Severity, check_files
from alula.adopt.robot import robot_from_trees
from alula.generate.robot_files import robot_files
from alula.generate.writer import write_files
from alula.language.load import load_robot

TYPES = {"int": "3", "double": "0.5", "bool": "true", "std::string": "a b", "Pose": "1;2", "": "x"}
IDS = st.sampled_from(["MoveTo", "moveTo", "Move_To", "class", "Result", "not", "3D", "A.b", "Öffne", "ready", "main", "x", "X", "client"])
PORTS = st.sampled_from(["goal", "Goal", "success", "outcome", "halt_waits", "self", "class", "a_b", "aB", "if", "progress", "x1"])
VALUES = st.sampled_from(["entry", "literal", "nothing"])


@st.composite
def palettes(draw):
    """Return leaves: by ID what they are, and their ports with type and direction; some of them are declared."""
    names = draw(st.lists(IDS, min_size=1, max_size=5, unique=True))
    port = st.tuples(st.sampled_from(list(TYPES)), st.sampled_from(["input_port", "output_port", "inout_port"]))
    kinds = {name: draw(st.sampled_from(["Action", "Condition"])) for name in names}
    kinds[names[0]] = "Action"
    return {name: (kind, draw(st.booleans()), draw(st.dictionaries(PORTS, port, max_size=3))) for name, kind in kinds.items()}


@st.composite
def leaves(draw, palette):
    """Return a leaf of a palette; an entry belongs to a type, because one that is written keeps it."""
    name = draw(st.sampled_from(sorted(palette)))
    kind, _, ports = palette[name]
    given_ = []
    for port, (type_, direction) in ports.items():
        how = draw(VALUES)
        literal = TYPES[type_] if how == "literal" and direction == "input_port" else None
        value = literal if literal is not None else f"{{{type_.replace(':', '')}_{draw(st.integers(0, 1))}}}" if how == "entry" else None
        given_ += [f" {port}={quoteattr(value)}"] if value is not None else []
    return f"<{kind} ID={quoteattr(name)}{''.join(given_)}/>"


@st.composite
def files(draw):
    """Return the text of a file: a palette, and a tree of its leaves, of nodes with children of its own, and of BehaviorTree.CPP's."""
    palette = draw(palettes())

    def node(depth):
        kind = draw(st.sampled_from(["leaf"] if depth == 0 else ["leaf", "Sequence", "Fallback", "Inverter", "Own", "OwnTries"]))
        if kind == "leaf":
            return draw(leaves(palette))
        count = 1 if kind in {"Inverter", "Own"} else 2
        return f"<{kind}>{''.join(node(depth - 1) for _ in range(count))}</{kind}>"

    declared = "".join(
        f"<{kind} ID={quoteattr(name)}>"
        + "".join(f"<{direction} name={quoteattr(port)} type={quoteattr(type_)}/>" for port, (type_, direction) in ports.items())
        + f"</{kind}>"
        for name, (kind, told, ports) in palette.items()
        if told
    )
    first = next(f"<Action ID={quoteattr(name)}/>" for name, (kind, _, _) in palette.items() if kind == "Action")
    body = f'<BehaviorTree ID="Main"><Sequence>{first}{node(3)}</Sequence></BehaviorTree>'
    return f'<root BTCPP_format="4">{body}<TreeNodesModel>{declared}</TreeNodesModel></root>'


@settings(max_examples=25, deadline=None)
@given(files())
def test_a_robot_of_random_trees_checks_clean_generates_and_runs(text):
    with tempfile.TemporaryDirectory() as place:
        folder, robot = Path(place) / "trees", Path(place) / "rover"
        folder.mkdir()
        (folder / "main.xml").write_text(text, encoding="utf-8")
        wrong = []
        write_files(robot_from_trees("rover", mains_of(folder), folder, wrong.append).files, robot)
        assert not wrong
        mission = next((robot / "missions").iterdir())
        findings = check_files(robot / "skillsets/rover.skill", mission, robot=robot, proofs=False)
        assert [str(one) for one in findings if one.severity is Severity.ERROR] == []
        assert robot_files(load_robot(robot / "skillsets"))
        assert Mission.load(mission.stem, robot).run().outcome in {Outcome.ACCOMPLISHED, Outcome.GIVEN_UP}
