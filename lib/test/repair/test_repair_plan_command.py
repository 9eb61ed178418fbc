"""``alula plan``: what it prints, writes and ends with, on a small robot."""

from __future__ import annotations

import json
import os
import signal
from pathlib import Path
from typing import Any

import pytest
import yaml

pytest.importorskip("z3")
pytest.importorskip("py_trees")

from repair_rovers import FAULTS, ROUNDS, rover

from alula.cli.check import main as check
from alula.cli.plan import main
from alula.cli.repair import main as repair
from alula.repair import planning

HOME = ("--goal", "base.place == DOCKED", "--from", "base.place == AWAY")
NO_WAY = ("--goal", "eyes.laser == OK", "--from", "eyes.laser == BROKEN")
TIME = ("--time", "600")
"""It ends by its result, also on a busy machine."""
ALL_FAULTS = sorted(yaml.safe_load(FAULTS)["faults"])


@pytest.fixture
def robot(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the folder of the rover."""
    monkeypatch.setenv("ALULA_ROBOT", str(tmp_path / "rover"))
    rover(tmp_path / "rover", ROUNDS)
    return tmp_path / "rover"


def files_in(folder: Path) -> set[str]:
    return {str(one.relative_to(folder)) for one in folder.rglob("*")}


def test_a_plan_is_printed_and_nothing_is_written(robot: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(robot)
    before = files_in(robot)
    assert main([*HOME, *TIME]) == 0
    said = capsys.readouterr()
    assert said.out.startswith("planned, proved by check: base.dock; ")
    assert '<base.dock name="dock"/>' in said.out
    assert all(line.startswith("alula plan: ") for line in said.err.splitlines())
    assert files_in(robot) == before


def test_json_is_one_object_on_the_standard_output(robot: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([str(robot), *HOME, *TIME, "--json"]) == 0
    line, end = capsys.readouterr().out.split("\n")
    found = json.loads(line)
    assert end == ""
    assert (found["answer"], found["stopped"], found["plan"]["steps"]) == ("planned", False, ["base.dock"])
    fates = {fate["faults"][0]: fate for fate in found["fates"]}
    assert set(fates) == set(ALL_FAULTS) - set(found["not_looked_at"])
    assert not fates["laser"]["survives"]
    assert fates["laser"]["safe"]
    assert fates["bumper"]["survives"]


def test_what_is_written_is_what_is_printed_and_check_proves_it(robot: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = robot / "missions/home.xml"
    assert main([str(robot), *HOME, *TIME, "--json", "--out", str(out)]) == 0
    assert out.read_text() == json.loads(capsys.readouterr().out)["plan"]["xml"]
    assert files_in(out.parent) == {"main.xml", "home.xml"}
    states = robot / "skillsets/rover.skill"
    states.write_text(states.read_text().replace("place { initial DOCKED", "place { initial AWAY"))
    assert check([str(out), *TIME]) == 0


@pytest.mark.parametrize("words", [(), ("--json",)])
def test_what_is_impossible_says_why_and_writes_nothing(robot: Path, capsys: pytest.CaptureFixture[str], words: tuple[str, ...]) -> None:
    out = robot / "missions/none.xml"
    assert main([str(robot), *NO_WAY, *words, "--out", str(out)]) == 1
    said = capsys.readouterr().out
    assert not out.exists()
    if words:
        found = json.loads(said)
        assert (found["answer"], "plan" in found) == ("impossible", False)
        assert "base.drive can't start at first: sight" in found["reasons"]
    else:
        assert said.splitlines()[0] == "impossible"


def test_what_no_course_keeps_is_unknown_not_impossible(robot: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([str(robot), *HOME, *TIME, "--never", "base.dock running", "--json"]) == 1
    found = json.loads(capsys.readouterr().out)
    assert (found["answer"], found["tried"], found["stopped"]) == ("unknown", 1, False)
    (refused,) = found["refused"]
    assert refused["name"].endswith("base.dock")
    assert "`asked_never`" in refused["why"]


def test_without_time_nothing_is_known(robot: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([str(robot), *HOME, "--time", "0", "--never", "base.fly running", "--json"]) == 1
    found = json.loads(capsys.readouterr().out)
    assert (found["answer"], found["stopped"]) == ("unknown", True)
    assert found["refused"][-1]["why"] == "the search ended before it was judged"


REFUSED = (
    ((), "name what is to be reached: --goal CONDITION"),
    (("--goal", "touch"), "--goal 'touch': no skill fills this role by its success; there are arrival"),
    (("--goal", "arival"), "--goal 'arival': no skill fills this role by its success; there are arrival"),
    (("--goal", "base.place == HOME"), "base.place has no state HOME; it has DOCKED, AWAY"),
    (("--goal", "base.place == DOCKED"), "it is so at first; say what is so by --from"),
    ((*HOME, "--from", "base.place == AWAY and base.place == DOCKED"), "base.place can't be AWAY and DOCKED; name one state"),
    ((*HOME, "--from", "base.plaice == AWAY"), "there is no resource base.plaice; there are base.place, "),
    ((*HOME, "--never", "bse.place == AWAY"), "--never 'bse.place == AWAY': the property `asked`: there is no skillset `bse`"),
    ((*HOME, "--never", "base.fly running"), "--never 'base.fly running': the property `asked`: there is no skill `fly`"),
    ((*HOME, "--never", "running("), "--never 'running(': the property can't be read"),
    ((*HOME, "--never", "running(base.dock)"), "found `running`; write `base.dock running`"),
    (("--goal", "base.place == DOCKED -> base.place == AWAY"), "expected the end, found `->`; write `=>` for `->`"),
    (("--goal", "running(base.dock)"), "found `running`; write `base.dock running`"),
    ((*HOME, "--using", "base.fly"), "--using base.fly: there is no such skill; there are base.creep, "),
    ((*HOME, "--out", "{robot}/nowhere/plan.xml"), "--out {robot}/nowhere/plan.xml: there is no folder {robot}/nowhere; make it"),
    ((*HOME, "--out", "{robot}/missions"), "--out {robot}/missions: is a folder; name a file in it"),
)


@pytest.mark.parametrize(("words", "complaint"), REFUSED)
def test_what_can_not_be_asked_is_one_line_and_leaves_nothing(
    robot: Path, capsys: pytest.CaptureFixture[str], words: tuple[str, ...], complaint: str
) -> None:
    before = files_in(robot)
    assert main([str(robot), *(one.format(robot=robot) for one in words)]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.count("\n") == 1
    assert said.err.startswith("alula plan: ")
    assert complaint.format(robot=robot) in said.err
    assert files_in(robot) == before


@pytest.mark.parametrize("option", ["--out", "--svg"])
def test_a_repair_refuses_a_place_before_it_searches(robot: Path, capsys: pytest.CaptureFixture[str], option: str) -> None:
    assert repair([str(robot / "missions/main.xml"), "--fault", "laser", option, str(robot / "nowhere/it")]) == 2
    said = capsys.readouterr()
    assert (said.out, said.err.count("\n")) == ("", 1)
    assert f"{option} {robot}/nowhere/it: there is no folder {robot}/nowhere" in said.err


@pytest.mark.parametrize("text", ["-1", "nan", "inf", "soon"])
@pytest.mark.parametrize("command", [main, repair, check])
def test_a_time_that_is_none_is_refused(command: Any, text: str, robot: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        command([str(robot / "missions/main.xml"), f"--time={text}"])
    assert ended.value.code == 2
    assert f"--time: {text} is no number of seconds; write one from 0 on" in capsys.readouterr().err


def test_models_that_can_not_be_read_are_refused_with_their_file(robot: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (robot / "skillsets/rover.skill").write_text("skillset base {\n  resource place { initial }\n}\n")
    assert main([str(robot), *HOME]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert f"{robot}/skillsets/rover.skill has errors; `alula check" in said.err


@pytest.mark.parametrize(
    ("moment", "code", "answer"),
    [((planning.Judge, "parts"), 1, "unknown"), ((planning.Search, "run"), 0, "planned")],
    ids=["before a course is proved", "while a fault is answered"],
)
def test_ctrl_c_ends_it_with_what_is_proved(
    moment: tuple[Any, str], code: int, answer: str, robot: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The signal comes when the search first does this."""
    owner, name = moment
    does = getattr(owner, name)

    def interrupted(self: object, *words: Any, **options: Any) -> object:
        monkeypatch.setattr(owner, name, does)
        os.kill(os.getpid(), signal.SIGINT)
        return does(self, *words, **options)

    monkeypatch.setattr(owner, name, interrupted)
    handler = signal.getsignal(signal.SIGINT)
    out = robot / "missions/home.xml"
    assert main([str(robot), *HOME, *TIME, "--json", "--out", str(out)]) == code
    assert signal.getsignal(signal.SIGINT) is handler
    found = json.loads(capsys.readouterr().out)
    assert (found["answer"], found["stopped"], out.exists()) == (answer, True, code == 0)
    if code == 0:
        assert sorted(found["not_looked_at"]) == ALL_FAULTS
