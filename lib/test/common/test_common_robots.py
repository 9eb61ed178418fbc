"""The code of robots: each gets its own, whatever others in the same process call theirs."""

from __future__ import annotations

import sys

import pytest

from alula.common.robots import load_robot_folder


@pytest.fixture(autouse=True)
def _imports(monkeypatch):
    """Leave imports as they were."""
    monkeypatch.setattr(sys, "path", list(sys.path))
    before = dict(sys.modules)
    yield
    for name in set(sys.modules) - set(before):
        if name.partition(".")[0] in {"twin_parts", "twin_single", "twin_loose"}:
            del sys.modules[name]


def robot(folder, word):
    """Make a robot whose packages are called as those of every other robot here: a package, a module, a folder without __init__."""
    package, loose = folder / "python" / "twin_parts", folder / "python" / "twin_loose"
    package.mkdir(parents=True)
    loose.mkdir()
    (package / "__init__.py").write_text("")
    (package / "words.py").write_text(f"WORD = {word!r}\n")
    (package / "areas.py").write_text("from twin_parts.words import WORD\n\n\ndef areas():\n    return WORD\n")
    (folder / "python" / "twin_single.py").write_text(f"WORD = {word!r}\n")
    (loose / "report.py").write_text(f"WORD = {word!r}\n")
    (folder / "robot.yaml").write_text(
        f"name: {word}\npython: [python]\nparts: {{areas: twin_parts.areas:areas, hooks: twin_single, report: twin_loose.report}}\n"
    )
    (folder / "skillsets").mkdir()
    return load_robot_folder(folder)


def words(one):
    return one.part("areas")(), one.part("hooks").WORD, one.part("report").WORD


def test_two_robots_with_packages_of_one_name_get_their_own_code(tmp_path):
    first, second = robot(tmp_path / "first", "first"), robot(tmp_path / "second", "second")
    kept = first.part("areas")
    assert words(first) == ("first",) * 3
    assert words(second) == ("second",) * 3
    assert words(first) == ("first",) * 3
    assert first.part("areas") is kept


def test_a_robot_in_the_folder_of_another_gets_its_own_code(tmp_path):
    outer = robot(tmp_path / "outer", "outer")
    inner = robot(tmp_path / "outer" / "python" / "inner", "inner")
    assert [words(one)[0] for one in (outer, inner, outer, inner)] == ["outer", "inner", "outer", "inner"]
