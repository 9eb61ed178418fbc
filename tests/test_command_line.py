"""Wrong input, as a user types it: one clear line, exit code 2, nothing left behind."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from alula.cli.checkout import ROOT, checkout
from alula.cli.help import PAGE, page
from alula.cli.table import COMMANDS
from alula_testing.counterexamples import EXAMPLES
from alula_testing.waits import HANGS_S

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
        (["run"], "SCENARIO"),
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


def completed(line: str) -> list[str]:
    """Return how bash completes a line, with what ``alula completion`` prints."""
    told = """eval "$(alula completion bash)"; COMP_LINE=$0 COMP_POINT=${#0} COMP_TYPE=9; _python_argcomplete alula
        printf '%s\\n' "${COMPREPLY[@]}" """
    environment = {**os.environ, "PATH": f"{ALULA_ROOT}:{os.environ['PATH']}"}
    done = subprocess.run(["bash", "-c", told, line], cwd=ALULA_ROOT, env=environment, capture_output=True, text=True, check=True)
    return [word.rstrip() for word in done.stdout.split("\n") if word.strip()]


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("alula chec", {"check"}),
        ("alula bench bri", {"bridge"}),
        ("alula new ", {"robot"}),
        ("alula fly ma", {"mapping"}),
        ("alula fly mapping --fail ze", {"zed", "zed_depth"}),
        ("alula run mapping --mock --fail=lidar_m", {"lidar_mapping"}),
        ("alula odds missions/mapping.xml --with zed", {"zed=", "zed_depth="}),
        ("alula start navigation.goto_", {"navigation.goto_straight"}),
        ("alula why goto_s", {"goto_straight"}),
        ("alula start goto_straight sp", {"speed="}),
        ("alula transition navigation.SDK_authority AV", {"AVAILABLE"}),
        ("alula data video.", {"video.picture"}),
        ("alula --robot examples/rover run del", {"deliver"}),
        ("alula run --robot examples/rover del", {"deliver"}),
        ("alula check --to p", {"paper"}),
    ],
)
def test_completion_knows_commands_and_the_words_of_the_robot(line: str, words: set[str]) -> None:
    assert set(completed(line)) == words


@pytest.mark.skipif(shutil.which("fish") is None, reason="there is no fish")
def test_fish_completes() -> None:
    told = "alula completion fish | source; complete -C 'alula fly ma'"
    environment = {**os.environ, "PATH": f"{ALULA_ROOT}:{os.environ['PATH']}"}
    done = subprocess.run(["fish", "-c", told], cwd=ALULA_ROOT, env=environment, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["mapping"]


ZSH = """
zmodload zsh/zpty
zpty shell zsh -f -i
zpty -w shell 'PS1=; autoload -U compinit; compinit -u -D; eval "$(alula completion zsh)"; print set"" up'
zpty -r -m shell told '*set up*'
zpty -w -n shell $'alula fly ma\\t'
zpty -r -m shell told '*pping*'
zpty -w -n shell $' --fail lidar_m\\t'
zpty -r -m shell told '*apping*'
print -r -- completed
"""
"""A shell types into another one and reads what that adds; it waits for it without end."""


@pytest.mark.skipif(shutil.which("zsh") is None, reason="there is no zsh")
def test_zsh_completes() -> None:
    environment = {**os.environ, "PATH": f"{ALULA_ROOT}:{os.environ['PATH']}", "TERM": "dumb"}
    done = subprocess.run(
        ["zsh", "-f", "-c", ZSH], cwd=ALULA_ROOT, env=environment, capture_output=True, text=True, check=True, timeout=HANGS_S
    )
    assert done.stdout.split() == ["completed"]


def test_a_line_that_can_not_be_completes_to_nothing(tmp_path: Path) -> None:
    (tmp_path / "robot.yaml").write_text("name: [", encoding="utf-8")
    for line in ("alula 'x", "alula start nosuch ", f"alula --robot {tmp_path} run ", f"alula start --robot {tmp_path} "):
        assert completed(line) == []


def test_help_lists_every_command_and_a_pip_installation_the_librarys() -> None:
    listed = set(re.findall(r"^  (\w+)", alula("help").stdout, re.MULTILINE))
    assert listed == set(COMMANDS)
    assert alula("--help").stdout == alula("help").stdout == alula().stdout


def test_a_checkout_does_every_command_of_the_table() -> None:
    here = checkout()
    assert here is not None
    own = {"setup", "doctor", "test", "bench"}
    assert set(here.handlers) <= set(COMMANDS)
    assert {name for name, command in COMMANDS.items() if not command.anywhere} <= set(here.handlers) | own
    for handler in (*here.handlers.values(), *here.benches.values()):
        world = str(ALULA_ROOT / f"setup/in_ros{handler.world}")
        found = f"import importlib.util, sys; sys.exit(importlib.util.find_spec({handler.module!r}) is None)"
        assert subprocess.run([world, "python3", "-c", found], check=False).returncode == 0, handler


def test_the_front_needs_nothing_but_python(tmp_path: Path) -> None:
    """As on a bare machine: no site's packages, no variables."""
    begin = f"import sys; sys.path.insert(0, {str(ALULA_ROOT / 'lib')!r}); from alula.cli.__main__ import main; sys.exit(main())"
    for words, code in ((["help"], 0), (["check", "--help"], 0), (["chekc"], 2), (["check", "--jsno"], 2)):
        command = [sys.executable, "-I", "-S", "-c", begin, *words]
        done = subprocess.run(command, cwd=tmp_path, env={ROOT: str(ALULA_ROOT)}, capture_output=True, text=True, check=False)
        assert done.returncode == code, done.stderr


CLOSED = [name for name, command in COMMANDS.items() if not command.open]


@pytest.mark.parametrize("name", CLOSED)
def test_a_wrong_option_is_one_line_before_anything_is_set_up(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ALULA_STATE", str(tmp_path / "nothing"))
    done = alula(name, "--nosuch")
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1), done.stderr
    assert done.stderr.startswith(f"alula {name}: ")
    assert "--nosuch" in done.stderr
    assert not (tmp_path / "nothing").exists()


NAMING = ["up rbot", "down rbot", "status rbot", "doctor rbot", "service install rbot", "run patrol --on rbot", "fly patrol --on=rbot"]


@pytest.mark.parametrize("words", [*NAMING, "console --on rbot", "skills --on rbot"])
def test_an_unknown_deployment_is_one_line_before_anything_is_set_up(words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ALULA_STATE", str(tmp_path / "nothing"))
    robot = tmp_path / "rover"
    (robot / "deployments").mkdir(parents=True)
    (robot / "robot.yaml").write_text("name: rover\n", encoding="utf-8")
    (robot / "deployments/robot.yaml").touch()
    done = alula(*words.split(), "--robot", str(robot))
    said = f"alula: there is no deployment 'rbot' in {robot / 'deployments'}; did you mean `robot`?\n"
    assert (done.returncode, done.stdout, done.stderr) == (2, "", said)
    assert not (tmp_path / "nothing").exists()


def test_the_nearest_option_and_choice_are_named() -> None:
    assert alula("skills", "--domain", "300").stderr.startswith("alula skills: --domain: 300 does not lie between 0 and 232; ")
    assert alula("check", "--jsno").stderr == "alula check: there is no option --jsno; did you mean `--json`?\n"
    assert alula("replay", "x", "--from", "sensor").stderr == "alula replay: --from: there is no sensor; did you mean `sensors`?\n"


WITH_OPTIONS = ["fly", "replay", "check", "tree", "generate", "mock", "bridge", "console", "panel", "skills", "events", "expect", "conform"]


@pytest.mark.parametrize("command", WITH_OPTIONS)
def test_completion_knows_the_options_of_a_command(command: str) -> None:
    known = set(re.findall(r"--[a-z][a-z0-9-]*", alula(command, "--help").stdout))
    assert set(completed(f"alula {command} --")) - {"--robot"} == known - {"--help"}


@pytest.mark.usefixtures("unbuilt")
def test_the_drones_own_options_are_completed_where_no_ros_world_could_be_asked() -> None:
    assert completed("alula fly mapping --autop") == ["--autopilot"]


def test_the_page_of_commands_is_the_tables() -> None:
    here = checkout()
    assert here is not None
    folder = "docs/reference"
    assert (ALULA_ROOT / folder / PAGE).read_text(encoding="utf-8") == page(here), f"setup/in_ros2 python -m alula.cli.help {folder}"


def test_version_is_the_change_logs() -> None:
    newest = re.search(r"^## (\S+)", (ALULA_ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert newest is not None
    assert alula("--version").stdout == alula("version").stdout == f"alula {newest[1]}\n"
    for place in ("lib/setup.py", "lib/package.xml", "CITATION.cff", "ros2_ws/src/skillset_ros2/package.xml"):
        assert newest[1] in (ALULA_ROOT / place).read_text(encoding="utf-8"), place


def test_doctor_finds_all_well() -> None:
    done = alula("doctor")
    assert done.returncode == 0, done.stdout
    assert "missing " not in done.stdout
