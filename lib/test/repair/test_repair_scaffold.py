"""What a new robot's mission does about what is in the way, from nothing: its fault can be taken away, and may come again."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("z3")
pytest.importorskip("py_trees")

from alula.generate.scaffold.skeleton import files_of, write
from alula.prove.limits import Deadline
from alula.repair.judging import Judge
from alula.repair.repairing import Question, Search
from alula.repair.subject import Subject

TIME_S = 600.0
"""What a search may take: it ends by its result, also on a busy machine."""


def quiet(_line: str) -> None:
    """Take no notice."""


@pytest.fixture
def subject(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Subject:
    """The patrol that gives up when its bumper is pressed."""
    robot = tmp_path / "porter"
    write(robot, files_of(robot.name))
    monkeypatch.setenv("ALULA_ROBOT", str(robot))
    path = robot / "missions/patrol.xml"
    text = path.read_text()
    start, end = text.index('<Sequence name="retreat">'), text.index('<AlwaysFailure name="given up"/>')
    path.write_text(text[:start] + text[end:])
    return Subject.read(path, quiet)


@pytest.mark.parametrize("most", [1, 2])
def test_the_drive_gets_another_chance_as_often_as_an_obstacle_may_come(subject: Subject, most: int) -> None:
    answer = Search(subject, Question("obstacle", most_faults=most, others=False), Deadline.after(TIME_S), quiet).run()
    assert answer.repair is not None
    fates = [Judge(subject, Deadline.after(TIME_S), strikes=more).fate(answer.repair.text, ["obstacle"]) for more in (most, most + 1)]
    assert [fate.survives for fate in fates] == [True, False]
    assert fates[1].run.count("porter.bumper PRESSED") == most, "the first one is the fault itself"
    (leaf,) = [one for one in answer.repair.branch.tree.iterate() if one.tag == "porter.back_off"] if answer.repair.branch.tree else []
    assert leaf.get("distance") == "{back_off_m}", "the mission has an input of the skill's name"
