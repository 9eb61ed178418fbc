"""What is generated replaces what was there as a whole, or not at all."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from generate_rover import SKILL

from alula.cli.generate import main
from alula.generate import robot_files
from alula.generate.writer import write_files
from alula.language.load import load_robot


def tree(folder: Path) -> dict[str, bytes]:
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def test_the_same_models_touch_nothing(robot_folder, tmp_path, capsys):
    out = tmp_path / "deep" / "out"
    assert main([str(robot_folder), "--out", str(out)]) == 0
    before = {path: path.stat().st_mtime_ns for path in out.rglob("*")}
    assert main([str(robot_folder), "--out", str(out)]) == 0
    assert {path: path.stat().st_mtime_ns for path in out.rglob("*")} == before
    assert "rover_managers (as it was)" in capsys.readouterr().out


def test_a_change_replaces_whole_packages_and_nothing_else(robot_folder, tmp_path):
    out = tmp_path / "out"
    main([str(robot_folder), "--out", str(out)])
    (out / "README").write_text("mine")
    (out / "rover_managers" / "old.py").write_text("left from an older model")
    (robot_folder / "rover.skill").write_text(SKILL.replace("skill wait {", "skill idle {"))
    assert main([str(robot_folder), "--out", str(out)]) == 0
    present = tree(out)
    assert set(present) == {*robot_files(load_robot(robot_folder)), "README"}
    assert "rover_interfaces/action/Idle.action" in present
    assert "rover_interfaces/action/Wait.action" not in present


def test_an_error_in_one_of_two_robots_changes_nothing_and_tells_all(robot_folder, tmp_path, capsys):
    out = tmp_path / "out"
    main([str(robot_folder), "--out", str(out)])
    before = tree(out)
    (robot_folder / "rover.skill").write_text(SKILL.replace("tries", "retries"))
    other = tmp_path / "other"
    other.mkdir()
    (other / "b.skill").write_text("skillset b { skill f { progress } }")
    assert main([str(robot_folder), str(other), str(tmp_path / "none"), "--out", str(out)]) == 2
    assert tree(out) == before
    told = capsys.readouterr().err
    assert "b.skill:1:33: error ALU103: expected `=`, found `}`" in told
    assert "none: error ALU006" in told


def test_two_robots_with_skillsets_of_one_name(robot_folder, tmp_path, capsys):
    twin = tmp_path / "twin"
    shutil.copytree(robot_folder, twin)
    assert main([str(robot_folder), str(twin), "--out", str(tmp_path / "out")]) == 2
    assert "ALU404" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_folder_that_cannot_be_written(robot_folder, tmp_path, capsys):
    (tmp_path / "out").write_text("a file")
    assert main([str(robot_folder), "--out", str(tmp_path / "out")]) == 2
    assert "can't be written" in capsys.readouterr().err


def test_a_move_that_fails_leaves_the_old(files, tmp_path, monkeypatch):
    out = tmp_path / "out"
    write_files(files, out)
    before = tree(out)
    rename = Path.rename

    def failing(self, target):
        if "new" in self.parts:
            raise OSError(28, "No space left on device")
        return rename(self, target)

    monkeypatch.setattr(Path, "rename", failing)
    changed = {path: text + "\n" for path, text in files.items()}
    with pytest.raises(OSError, match="No space"):
        write_files(changed, out)
    assert tree(out) == before
