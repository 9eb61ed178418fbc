"""The branches that missions have by hand are deleted; the tool writes others, which `check` proves and mocks fly."""

from __future__ import annotations

import io
import json
import os
import re
import signal
import subprocess
import sys
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import pytest
import yaml

from alula import Mission
from alula.check.robot import part_of
from alula.cli.check import main as check
from alula.cli.compare import main as compare
from alula.cli.plan import main as plan
from alula.cli.repair import main as repair
from alula.cli.run import main as run
from alula.common.robots import find_robot
from alula.common.scenarios import load_scenario
from alula.missions.director import Outcome
from alula.missions.drawing import ROW_PX
from alula.missions.mission_file import plan_of_file
from alula.missions.mocked import MockedMission
from alula.missions.scenario import inputs_of
from alula_testing.flights import start_flight, with_mission
from repair_bench.cases import copied, without_chances, without_end, without_lidar, without_video_end

ALULA_ROOT = Path(__file__).resolve().parents[1]
TIME_S = "600"
"""What a search may take here: it ends by its result, also on a busy machine."""
LONG = "ALULA_LONG_REPAIRS"
WITHIN_S = "5"
"""How much sooner or later two live flights may decide the same: two of one tree have differed by 1.9 s; a leg takes 15 s and more."""


@pytest.fixture
def missions(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a folder with the drone's missions, to be changed."""
    monkeypatch.setenv("ALULA_ROBOT", str(ALULA_ROOT))
    copied(ALULA_ROOT, tmp_path)
    return tmp_path


def answer(capsys: pytest.CaptureFixture[str], *words: str | Path, code: int = 0) -> dict[str, object]:
    assert repair([*map(str, words), "--time", TIME_S, "--json"]) == code, capsys.readouterr().err
    found: dict[str, object] = json.loads(capsys.readouterr().out)
    return found


@pytest.fixture
def no_lidar(missions: Path) -> Path:
    return without_lidar(ALULA_ROOT, missions).mission


PAGE = re.findall(
    r"^ {4}(alula|mv) (.*?)(?: +#.*)?$", (ALULA_ROOT / "docs/how-to/repairs.md").read_text().split("## In five")[1], re.MULTILINE
)[:5]
"""The page's commands."""


class Repaired(NamedTuple):
    """What the command of the page has said and written of a mission without its LiDAR branch, in the folder of a robot."""

    before: str
    found: dict[str, Any]
    progress: str
    out: Path
    robot: Path


@pytest.fixture(scope="module")
def repaired(tmp_path_factory: pytest.TempPathFactory) -> Repaired:
    robot = tmp_path_factory.mktemp("robot")
    for entry in ALULA_ROOT.iterdir():
        if entry.name not in {".git", "missions", "runs"}:
            (robot / entry.name).symlink_to(entry)
    (robot / "missions").mkdir()
    mission = without_lidar(ALULA_ROOT, robot / "missions").mission
    before = mission.read_text()
    (words,) = [words.split()[1:] for _, words in PAGE if words.startswith("repair ")]
    said, progress = io.StringIO(), io.StringIO()
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(said), redirect_stderr(progress):
        patch.setenv("ALULA_ROBOT", str(robot))
        patch.chdir(robot)
        code = repair([*words, "--time", TIME_S, "--json"])
    assert code == 0, progress.getvalue()
    assert mission.read_text() == before  # only --out is written
    return Repaired(before, json.loads(said.getvalue()), progress.getvalue(), robot / words[words.index("--out") + 1], robot)


def test_the_flight_goes_on_with_the_lidar_as_in_figure_10(repaired: Repaired) -> None:
    assert repaired.found["answer"] == "repaired"
    one = repaired.found["repair"]
    assert one["nodes"] <= 15
    skills = re.findall(r"<(\w+\.\w+) ", one["xml"])
    others = ["navigation.rotate_head", "navigation.lock_head", "navigation.goto"]
    assert skills == ["perception.lidar_depthmap", "uav.NextWaypoint", *others]
    assert 'heading="{sideways}"' in one["xml"]
    fates = [*(one["after"]["faults"] for one in repaired.found["fates"]), *repaired.found["not_looked_at"]]
    known = yaml.safe_load((ALULA_ROOT / "skillsets/uav/faults.yaml").read_text(encoding="utf-8"))["faults"]
    assert {name for (name,) in fates} >= set(known)  # each is told of, or named
    assert repaired.found["not_asked"] == []  # the names that the properties ask for are there again
    (zed,) = [one for one in repaired.found["fates"] if one["after"]["faults"] == ["zed"]]
    assert (zed["before"]["survives"], zed["after"]["survives"]) == (False, True)


def test_what_is_written_is_proved_by_check(
    repaired: Repaired, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ALULA_ROBOT", str(repaired.robot))
    assert check([str(repaired.out), "--json", "--time", TIME_S]) == 0
    (file,) = json.loads(capsys.readouterr().out)["files"]
    assert [finding["severity"] for finding in file["findings"]] == ["note"]  # what the file accepts, as before


def test_the_file_keeps_all_that_stood_in_it(repaired: Repaired) -> None:
    left = iter(repaired.out.read_text().split("\n"))
    assert all(line in left for line in repaired.before.split("\n"))  # in its order


def test_the_drawing_has_a_band_for_each_node_of_the_branch(repaired: Repaired) -> None:
    nodes, bands = (
        repaired.found["repair"]["nodes"],
        (repaired.robot / "my_repair.svg").read_text().count(f"width='100%' height='{ROW_PX}'"),
    )
    assert bands == nodes + 1  # and the use of its tree


def test_the_picture_of_the_page_is_what_its_command_draws(repaired: Repaired) -> None:
    """Else: copy the file that the page's second command draws to ``docs/pictures/repaired.svg``."""
    assert (repaired.robot / "my_repair.svg").read_text() == (ALULA_ROOT / "docs/pictures/repaired.svg").read_text()


def test_the_pages_commands_repair_the_mission(repaired: Repaired, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """The search was run before; `check` is in a test of its own."""
    kinds = [words.split()[0] for _, words in PAGE]
    assert kinds == ["run", "repair", "check", "missions/my_repair.xml", "run"]
    kept = repaired.out.read_text()
    outcomes = []
    for number, (command, words) in enumerate(PAGE):
        if command == "mv":
            source, target = words.split()
            (repaired.robot / source).rename(repaired.robot / target)
        elif kinds[number] == "run":
            out = tmp_path / str(number)
            monkeypatch.setenv("ALULA_ROBOT", str(repaired.robot))
            run([*words.split()[1:], "--out", str(out)])
            outcomes.append(json.loads((out / "summary.json").read_text())["outcome"])
    repaired.out.write_text(kept)
    assert outcomes == ["given_up", "degraded"]


def test_progress_shows_what_counterexamples_rule_out(repaired: Repaired) -> None:
    assert repaired.progress.count("no: the property `eyes` (always) does not hold") == 1  # what would run the same again is not tried


def test_a_mission_that_survives_needs_nothing(missions: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert answer(capsys, missions / "mapping.xml", "--fault", "zed")["answer"] == "nothing to repair"


def test_without_another_sensor_it_is_impossible_and_says_why(no_lidar: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = answer(capsys, no_lidar, "--fault", "zed", "--using", "navigation.goto", code=1)
    assert found["answer"] == "impossible"
    reasons = found["reasons"]
    assert isinstance(reasons, list)
    assert "in no run without perception.zed_depthmap, and of navigation.goto none is for the same" in reasons[0]
    assert "perception.zed_depthmap can't start any more: it is refused by `zed_ready`" in reasons[1]
    assert "it could if perception.zed_status" in reasons[1]


def test_a_branch_may_be_forbidden_to_do_something(no_lidar: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = answer(capsys, no_lidar, "--fault", "zed", "--most-faults", "1", "--never", "navigation.lock_head running", code=1)
    assert (found["answer"], found["stopped"]) == ("unknown", False)


def test_a_branch_that_an_abort_or_a_death_breaks_is_no_repair(no_lidar: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The branch is proved without them; `--never` asks for what only an abort brings about, with the branch and without it."""
    asked = ("--fault", "zed", "--most-faults", "1", "--never", "outcome aborted")
    assert answer(capsys, no_lidar, *asked, code=1)["answer"] == "unknown"


def test_a_goal_is_as_good_as_an_accomplished_mission(no_lidar: Path, capsys: pytest.CaptureFixture[str]) -> None:
    goal = "outcome given_up and navigation.flight_status == ON_GROUND"
    assert answer(capsys, no_lidar, "--fault", "zed", "--goal", goal)["answer"] == "nothing to repair"


def test_nothing_maps_without_the_lidar(missions: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = answer(capsys, missions / "mapping.xml", "--fault", "lidar", code=1)
    assert found["answer"] == "impossible"
    assert "mapping.lidar_mapping" in str(found["reasons"])


def test_the_end_by_which_a_mission_gives_up_is_written_again(missions: Path, capsys: pytest.CaptureFixture[str]) -> None:
    mission = without_end(ALULA_ROOT, missions).mission
    found = answer(capsys, mission, "--fault", "lidar", "--most-faults", "1")
    one = found["repair"]
    assert isinstance(one, dict)
    assert re.findall(r"<(\w+) ", one["xml"])[1:] == ["ForceFailure", "Sequence", "NoteReason", "Script", "SubTree"]
    fates = found["fates"]
    assert isinstance(fates, list)
    (lidar,) = [fate for fate in fates if fate["after"]["faults"] == ["lidar"]]
    assert (lidar["before"]["safe"], lidar["after"]["safe"]) == (False, True)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--fault", "zedd"], "--fault zedd: there is no such fault"),
        ([], "name what is to be answered: --fault NAME, or --finding N"),
        (["--fault", "zed", "--using", "navigation.gota"], "--using navigation.gota: there is no such skill"),
        (["--fault", "zed", "--within", "nowhere"], "--within nowhere: there is no such node"),
        (["--fault", "zed", "--never", "navigation.gota running"], "--never 'navigation.gota running'"),
        (["--fault", "zed", "--goal", "outcome =="], "--goal 'outcome ==': can't be read as a condition"),
        (["--finding", "7"], "--finding 7: the mission has"),
    ],
)
def test_what_can_not_be_asked_is_one_line(no_lidar: Path, capsys: pytest.CaptureFixture[str], words: list[str], message: str) -> None:
    assert repair([str(no_lidar), *words]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert message in said.err.splitlines()[-1]


def test_more_faults_than_are_looked_at_can_not_be_asked_for(no_lidar: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        repair([str(no_lidar), "--fault", "zed", "--most-faults", "3"])
    assert ended.value.code == 2
    assert "--most-faults: there is no 3" in capsys.readouterr().err


def flown(mission: Mission, path: Path, *faults: str) -> MockedMission:
    """Fly a file over mocks instead of the scenario's own."""
    inputs = inputs_of(load_scenario("mapping"))
    part = part_of(find_robot(), pytest.fail)
    return replace(mission, plan=plan_of_file(path, "mapping", mission.skillsets, inputs, part)).run(*faults, seed=1)


def test_over_mocks_all_faults_end_as_with_the_branch_by_hand(repaired: Repaired, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ALULA_ROBOT", str(ALULA_ROOT))
    mission = Mission.load("mapping", ALULA_ROOT)
    for fault in mission.behaviour.faults:
        for moment in (5, 12, 25):
            ours = flown(mission, repaired.out, f"{fault}@{moment}")
            theirs = flown(mission, ALULA_ROOT / "missions/mapping.xml", f"{fault}@{moment}")
            assert ours.outcome is theirs.outcome, f"{fault}@{moment}"
            assert decisions(ours) == decisions(theirs), f"{fault}@{moment}"
            assert ours.world.now_s == pytest.approx(theirs.world.now_s, abs=1.0)
    assert flown(mission, repaired.out, "zed@12").outcome is Outcome.DEGRADED


def decisions(run: MockedMission) -> list[str]:
    """Return the skills that have ended, in their order."""
    return [one.skill for one in run.ended]


@pytest.mark.flight
@pytest.mark.long
@pytest.mark.timeout(0)  # two flights: as long as the machine needs
def test_live_the_written_branch_decides_what_the_one_by_hand_does(
    repaired: Repaired, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    checkout = with_mission(tmp_path / "checkout", "mapping.xml", repaired.out.read_text())
    lost = ("--rate", "0", "--seed", "1", "--fail", "zed@12")
    flights = [start_flight(tmp_path / "by-hand", *lost), start_flight(tmp_path / "written", *lost, checkout=checkout)]
    try:
        for flight in flights:
            flight.end(0)
    finally:
        for flight in flights:
            flight.give_up()
    assert [flight.summary["outcome"] for flight in flights] == ["degraded", "degraded"]
    assert compare([*(str(flight.out) for flight in flights), "--within", WITHIN_S]) == 0, capsys.readouterr().out


@pytest.mark.skipif(LONG not in os.environ, reason=f"takes more than a minute of processor time: {LONG}=1 runs it")
@pytest.mark.timeout(0)  # as long as the machine needs
def test_a_lost_radio_ends_an_inspection_degraded_unless_the_autopilot_flies_home(
    missions: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    found = answer(capsys, without_video_end(ALULA_ROOT, missions).mission, "--fault", "radio")
    assert (found["answer"], found["assuming"]) == ("repaired", ["navigation.SDK_authority UNAVAILABLE"])
    one = found["repair"]
    assert isinstance(one, dict)
    assert one["nodes"] <= 15
    assert 'ID="stop_here"' in one["xml"]


# --- the rover ----------------------------------------------------------------------------------------------------------


@pytest.fixture
def rover(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a folder with the rover's missions, to be changed."""
    monkeypatch.setenv("ALULA_ROBOT", str(ALULA_ROOT / "examples/rover"))
    copied(ALULA_ROOT / "examples/rover", tmp_path)
    return tmp_path


@pytest.mark.long
@pytest.mark.timeout(0)  # a minute of processor time: as long as the machine needs
def test_a_way_that_is_blocked_gets_another_chance(rover: Path, capsys: pytest.CaptureFixture[str]) -> None:
    mission = without_chances(ALULA_ROOT, rover).mission
    found = answer(capsys, mission, "--fault", "person")
    assert found["answer"] == "repaired"
    one = found["repair"]
    assert isinstance(one, dict)
    assert one["around"]
    needed = "base.authority == MISSION &amp;&amp; base.link == UP &amp;&amp; base.pose_status == GOOD"
    written = " ".join(one["xml"].split())  # an element of more than a line's width is broken between its attributes
    assert written == f'<RetryAfter name="three chances to follow the walls" attempts="3" wait="1" if="{needed}"/>'
    fates = found["fates"]
    assert isinstance(fates, list)
    assert [fate["after"]["survives"] for fate in fates if fate["after"]["faults"] == ["person"]] == [True]


@pytest.mark.parametrize("fault", ["laser", "person", "door", "battery"])
def test_the_rover_survives_as_it_is(rover: Path, capsys: pytest.CaptureFixture[str], fault: str) -> None:
    assert answer(capsys, rover / "patrol.xml", "--fault", fault)["answer"] == "nothing to repair"
    mission = Mission.load("patrol", ALULA_ROOT / "examples/rover")
    for moment in (1, 20, 60) if fault in mission.behaviour.faults else ():
        assert mission.run(f"{fault}@{moment}", seed=1).outcome in {Outcome.ACCOMPLISHED, Outcome.DEGRADED}, f"{fault}@{moment}"


PATROL = "arrival then base.base_status == DOCKED"
DELIVER = "arrival then cargo.box == FULL then arrival then cargo.box == EMPTY then base.base_status == DOCKED"
INPUTS = {
    "target": {"x": 2.0, "y": 0.0, "theta": 0.0},
    "target_2": {"x": 4.0, "y": 1.0, "theta": 0.0},
    "parcel": "letter",
    "patience": 30.0,
}


@pytest.mark.long
@pytest.mark.timeout(0)  # a minute of processor time: as long as the machine needs
@pytest.mark.parametrize(
    ("scenario", "goal", "skills", "survived"),
    [
        ("patrol", PATROL, ["drive_to", "dock"], {"navigation", "person"}),
        ("deliver", DELIVER, ["drive_to", "load", "drive_to", "unload", "dock"], {"door", "navigation"}),
    ],
)
def test_what_the_rover_does_for_one_place_and_one_parcel_is_planned(
    rover: Path, capsys: pytest.CaptureFixture[str], scenario: str, goal: str, skills: list[str], survived: set[str]
) -> None:
    out = rover / "planned.xml"
    using = ",".join(f"{'cargo' if one in {'load', 'unload'} else 'base'}.{one}" for one in dict.fromkeys(skills))
    assert plan(["--goal", goal, "--using", using, "--out", str(out), "--time", TIME_S, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert [one.partition(".")[2] for one in found["plan"]["steps"]] == skills
    assert found["plan"]["nodes"] <= 15
    fates = {one["faults"][0]: one for one in found["fates"]}
    assert {name for name, one in fates.items() if one["survives"]} >= survived
    assert check([str(out), "--json", "--time", TIME_S]) == 0
    findings = json.loads(capsys.readouterr().out)["files"][0]["findings"]
    assert {one["severity"] for one in findings} <= {"note"}, "what the goal asks for"
    mission = Mission.load(scenario, ALULA_ROOT / "examples/rover")
    name = re.findall(r'main_tree_to_execute="(\w+)"', out.read_text())[0]
    asked = {key: value for key, value in INPUTS.items() if f'"{key}"' in out.read_text()}
    planned = replace(mission, plan=plan_of_file(out, name, mission.skillsets, asked, part_of(find_robot(), pytest.fail)))
    well = planned.run(seed=1)
    assert (well.outcome, [one.skill for one in well.ended if one.skill in skills]) == (Outcome.ACCOMPLISHED, skills)
    for fault in mission.behaviour.faults:
        for moment in (1, 4, 9):
            outcome = planned.run(f"{fault}@{moment}", seed=1).outcome
            good = {Outcome.ACCOMPLISHED, Outcome.DEGRADED}
            survives = fates[fault.partition(":")[0]]["survives"]
            assert outcome in (good if survives else good | {Outcome.GIVEN_UP}), f"{fault}@{moment}"


def test_ctrl_c_ends_the_search_with_what_it_has(no_lidar: Path) -> None:
    """It comes in the proof of a branch, which would otherwise end that proof alone."""
    words = [sys.executable, "-m", "alula.cli.repair", str(no_lidar), "--fault", "zed", "--most-faults", "1", "--time", TIME_S, "--json"]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as search:
        assert search.stderr is not None
        assert search.stdout is not None
        for line in search.stderr:
            if "may not be accomplished, and may end in no safe state" in line:
                search.send_signal(signal.SIGINT)
                break
        said, progress = search.stdout.read(), search.stderr.read()
        assert search.wait() == 1, progress
    found = json.loads(said)
    assert (found["answer"], found["stopped"]) == ("unknown", True)
    assert found["refused"][-1]["why"] == "the search ended before it was judged"
