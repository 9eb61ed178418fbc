"""Wrong input, as a user types it: one clear line, exit code 2, nothing left behind."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

ALULA_ROOT = Path(__file__).resolve().parents[1]


def alula(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([str(ALULA_ROOT / "alula"), *arguments], capture_output=True, text=True, timeout=120, check=False)


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["nosuch"], "nosuch"),
        (["fly", "nosuch"], "nosuch"),
        (["fly", "mapping", "--fail", "nosuch"], "nosuch"),
        (["fly", "mapping", "--seed", "x"], "--seed"),
        (["check", "no/such/file.skill"], "no/such/file.skill"),
        (["setup", "now"], "now"),
        (["bench", "nosuch"], "nosuch"),
        (["mock", "no/such/folder"], "no/such/folder"),
        (["panel", "--run", "no/such/run"], "no/such/run"),
        (["new", "robot", "Small-Rover"], "Small-Rover"),
        (["bridge", "--config", "no/such/file.yaml"], "no/such/file.yaml"),
    ],
)
def test_wrong_input_is_exit_code_2_and_names_it(arguments: list[str], named: str) -> None:
    done = alula(*arguments)
    said = done.stdout + done.stderr  # findings of `check` are its output, as any linter's
    assert done.returncode == 2
    assert named in said
    assert "Traceback" not in said


def test_skillset_with_a_syntax_error_shows_where(tmp_path: Path) -> None:
    broken = tmp_path / "broken.skill"
    broken.write_text("skillset broken {\n  resource door {\n    initial SHUT\n    SHUT -> -> OPEN\n  }\n}\n", encoding="utf-8")
    done = alula("check", str(broken))
    said = done.stdout + done.stderr
    assert done.returncode == 1
    assert f"{broken}:4:" in said
    assert "SHUT -> -> OPEN" in said
    assert "^" in said


def test_models_of_the_drone_have_no_errors() -> None:
    models = sorted(str(path) for path in (ALULA_ROOT / "skillsets/uav").glob("*.skill"))
    assert len(models) == 3
    done = alula("check", *models)
    assert done.returncode == 0, done.stdout + done.stderr


def test_second_setup_has_nothing_to_do() -> None:
    done = alula("setup")
    assert done.returncode == 0
    assert "done" not in done.stdout


def test_doctor_finds_all_well() -> None:
    done = alula("doctor")
    assert done.returncode == 0, done.stdout
    assert "missing " not in done.stdout
