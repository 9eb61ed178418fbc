"""Wrong input, as a user types it: one clear line, exit code 2, nothing left behind."""

from __future__ import annotations

import json
import os
import re
import subprocess
from pathlib import Path

import pytest

from alula.cli import COMMANDS
from alula_testing.counterexamples import EXAMPLES

ALULA_ROOT = Path(__file__).resolve().parents[1]


def alula(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([str(ALULA_ROOT / "alula"), *arguments], capture_output=True, text=True, check=False)


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["nosuch"], "nosuch"),
        (["fyl"], "did you mean `fly`?"),
        (["flie"], "did you mean `fly`?"),
        (["fly", "maping"], "did you mean `mapping`?"),
        (["bench", "skils"], "did you mean `skills`?"),
        (["events", "--run", "no/such/run"], "no/such/run"),
        (["start"], "SKILL"),
        (["fly", "nosuch"], "nosuch"),
        (["fly", "mapping", "--fail", "nosuch"], "nosuch"),
        (["fly", "mapping", "--seed", "x"], "--seed"),
        (["check", "no/such/file.skill"], "no/such/file.skill"),
        (["setup", "now"], "now"),
        (["bench", "nosuch"], "nosuch"),
        (["mock", "no/such/folder"], "no/such/folder"),
        (["panel", "--run", "no/such/run"], "no/such/run"),
        (["console", "--run", "no/such/run"], "no/such/run"),
        (["new", "robot", "Small-Rover"], "Small-Rover"),
        (["new", "robot", "docs"], "docs"),
        (["run"], "scenario"),
        (["conform", "no/such/run"], "no/such/run"),
        (["expect", "no/such/run"], "no/such/run"),
        (["compare", "no/such/run", "no/such/run"], "no/such/run"),
        (["campaign", "no/such/file.yaml"], "no/such/file.yaml"),
        (["bridge", "--config", "no/such/file.yaml"], "no/such/file.yaml"),
    ],
)
def test_wrong_input_is_exit_code_2_and_names_it(arguments: list[str], named: str) -> None:
    done = alula(*arguments)
    said = done.stdout + done.stderr  # findings of `check` are its output, as any linter's
    assert done.returncode == 2
    assert named in said
    assert "Traceback" not in said


@pytest.mark.parametrize("words", ["run patrol", "fly mapping", "mock", "check", "test", "replay x", "campaign x"])
def test_where_there_is_no_robot_one_line_says_what_to_do(words: str, tmp_path: Path) -> None:
    done = outside(tmp_path, *words.split())
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1), done.stderr
    assert "there is no robot.yaml" in done.stderr
    assert "--robot DIR" in done.stderr


def outside(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Run a command in a folder where there is no robot."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith("ALULA_ROBOT")}
    return subprocess.run([str(ALULA_ROOT / "alula"), *words], cwd=folder, env=environment, capture_output=True, text=True, check=False)


def test_what_needs_no_robot_works_without_one(tmp_path: Path) -> None:
    model, run = str(ALULA_ROOT / "skillsets/uav/mapping.skill"), str(ALULA_ROOT / "tests/recordings/mapping")
    models = [word for file in sorted((ALULA_ROOT / "skillsets/uav").glob("*.skill")) for word in ("--model", str(file))]
    for words in (["help"], ["completion"], ["doctor"], ["check", "--no-proofs", model], ["conform", run, *models]):
        done = outside(tmp_path, *words)
        assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("words", [["--robot", "{}", "mock", "--starter"], ["mock", "--starter", "--robot={}"]])
def test_the_robot_is_named_anywhere_on_the_command_line(words: list[str], tmp_path: Path) -> None:
    done = outside(tmp_path, *(word.format(ALULA_ROOT) for word in words))
    assert done.returncode == 0, done.stderr
    assert "navigation.takeoff" in done.stdout


def test_a_folder_that_is_no_robot_is_refused_by_name(tmp_path: Path) -> None:
    done = outside(tmp_path, "check", "--robot", str(tmp_path))
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert str(tmp_path) in done.stderr


def test_skillset_with_a_syntax_error_shows_where(tmp_path: Path) -> None:
    broken = tmp_path / "broken.skill"
    broken.write_text("skillset broken {\n  resource door {\n    initial SHUT\n    SHUT -> -> OPEN\n  }\n}\n", encoding="utf-8")
    done = alula("check", str(broken))
    said = done.stdout + done.stderr
    assert done.returncode == 1
    assert f"{broken}:4:" in said
    assert "SHUT -> -> OPEN" in said
    assert "^" in said


def test_a_counterexample_of_any_model_plays(tmp_path: Path) -> None:
    model = tmp_path / "lamp.rl"
    model.write_text(EXAMPLES["ALU503"], encoding="utf-8")
    done = alula("check", "--play", "1", "--json", str(model))
    assert done.returncode == 0, done.stderr
    played = json.loads(done.stdout)
    assert played["agrees"]
    assert len(played["steps"]) == 4


def test_models_of_the_drone_have_no_errors() -> None:
    models = sorted(str(path) for path in (ALULA_ROOT / "skillsets/uav").glob("*.skill"))
    assert len(models) == 4
    done = alula("check", *models)
    assert done.returncode == 0, done.stdout + done.stderr


def test_second_setup_has_nothing_to_do_and_results_only_go_to_stdout() -> None:
    done = alula("setup")
    assert done.returncode == 0
    assert "Alula is ready" in done.stderr
    assert "done" not in done.stderr
    assert done.stdout == ""


@pytest.fixture
def unbuilt(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Have both worlds' Python and nothing else, and no folder for a set-up's logs: what needs a build ends with 2."""
    state = Path(os.environ.get("ALULA_STATE", ALULA_ROOT / ".alula"))
    made = tmp_path / "state"
    (made / "stamps").mkdir(parents=True)
    for step in ("venv2", "wheels"):
        (made / "stamps" / step).touch()
    (made / "log").touch()
    for world in ("venv1", "venv2"):
        (made / world).symlink_to(state / world)
    monkeypatch.setenv("ALULA_STATE", str(made))


@pytest.mark.usefixtures("unbuilt")
def test_what_works_on_models_needs_no_build_and_prints_results_only(tmp_path: Path) -> None:
    model, mission = ALULA_ROOT / "skillsets/uav/mapping.skill", ALULA_ROOT / "missions/mapping.xml"
    checked, drawn = alula("check", "--json", "--no-proofs", str(model)), alula("tree", str(mission))
    generated = alula("generate", str(model.parent), "--out", str(tmp_path / "made"))
    help_text, version = alula("help"), alula("--version")
    assert (checked.returncode, drawn.returncode, generated.returncode) == (0, 0, 0), checked.stderr + drawn.stderr + generated.stderr
    assert json.loads(checked.stdout) is not None
    assert "usage:" in help_text.stdout
    assert re.fullmatch(r"alula \d+\.\d+\.\d+\n", version.stdout)
    built = alula("panel")
    assert built.returncode == 2
    assert "is to be made" in built.stderr


def test_completion_is_a_bash_script_that_knows_commands() -> None:
    script = alula("completion").stdout
    complete = "COMP_WORDS=(alula ch); COMP_CWORD=1; _alula; echo ${COMPREPLY[@]}"
    done = subprocess.run(["bash", "-c", f"{script}\n{complete}"], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["check"]


def test_the_checkout_has_every_command_of_the_library() -> None:
    told = alula("help").stdout
    listed = set(re.findall(r"^  (\w+)", told, re.MULTILINE))
    assert set(COMMANDS) <= listed
    assert "language server" in alula("editor", "--help").stdout


OF_EACH_KIND = ["fly", "replay", "check", "tree", "generate", "mock", "bridge", "console", "panel", "skills", "events", "expect", "conform"]


@pytest.mark.parametrize("command", OF_EACH_KIND)
def test_completion_knows_the_options_of_a_command(command: str) -> None:
    complete = f"COMP_WORDS=(alula {command} x --); COMP_CWORD=3; _alula; echo ${{COMPREPLY[@]}}"
    script = f"{alula('completion').stdout}\n{complete}"
    done = subprocess.run(["bash", "-c", script], capture_output=True, text=True, check=True)
    known = set(re.findall(r"--[a-z][a-z-]*", alula(command, "--help").stdout))
    assert set(done.stdout.split()) - {"--robot"} == known - {"--help"}


def test_version_is_the_change_logs() -> None:
    newest = re.search(r"^## (\S+)", (ALULA_ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert newest is not None
    assert alula("--version").stdout == f"alula {newest[1]}\n"
    for place in ("lib/setup.py", "lib/package.xml", "CITATION.cff", "ros2_ws/src/skillset_ros2/package.xml"):
        assert newest[1] in (ALULA_ROOT / place).read_text(encoding="utf-8"), place


def test_doctor_finds_all_well() -> None:
    done = alula("doctor")
    assert done.returncode == 0, done.stdout
    assert "missing " not in done.stdout
