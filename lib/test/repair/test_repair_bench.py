"""What `alula bench repair` repairs: robots that grow; how long that takes is the bench's own business."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("z3")
pytest.importorskip("py_trees")

from alula.common.robots import load_robot_folder, meaning
from alula.prove.limits import Deadline
from alula.repair.repairing import Answer, Question, Search
from alula.repair.subject import Subject
from repair_bench.__main__ import measure
from repair_bench.cases import growing

TIME_S = 600.0


def answered(family: str, size: int, folder: Path) -> Answer:
    case = growing(family, size, folder)
    with meaning(load_robot_folder(case.robot)):
        return Search(Subject.read(case.mission, print), Question(case.fault), Deadline.after(TIME_S), print).run()


@pytest.mark.parametrize(
    ("family", "size", "answer", "nodes"), [("legs", 2, "repaired", 9), ("sensors", 4, "repaired", 8), ("at once", 2, "repaired", 11)]
)
def test_robots_that_grow_are_repaired(family: str, size: int, answer: str, nodes: int) -> None:
    row = measure(family, size, TIME_S)
    assert (row["answer"], row["nodes"]) == (answer, nodes)


def test_a_skill_that_may_not_watch_is_refuted_by_a_run(tmp_path: Path) -> None:
    repair = answered("sensors", 4, tmp_path).repair
    assert repair is not None
    assert "eyes.watch_3" in repair.branch.as_xml()


def test_what_does_not_matter_for_a_skill_is_not_played_through(tmp_path: Path) -> None:
    """Lamps beside a sensor change nothing of whether it can be used: as many situations are looked at with sixteen as with one."""
    several = [answered("lamps", count, tmp_path / str(count)) for count in (1, 16)]
    assert all(one.impossible for one in several)
    assert several[0].reasons == several[1].reasons
