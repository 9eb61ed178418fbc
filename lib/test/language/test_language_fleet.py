"""Models of a fleet: those of its robots, under names that say whose they are."""

from __future__ import annotations

from pathlib import Path

import pytest

from alula.cli.generate import main as generate
from alula.common.faults import parse_fault
from alula.common.robots import RobotError, load_robot_folder
from alula.language.errors import LanguageError
from alula.language.fleet import load_models
from alula.mock import mock_world
from alula.records.mocks import behaviour_of

MODEL = """\
type Width
skillset arm {
  resource grip { initial OPEN  OPEN -> SHUT  SHUT -> OPEN  extern OPEN -> STUCK }
  skill shut {
    input { width: Width }
    effect { close: grip -> SHUT }
    precondition { open: resource = (grip == OPEN)  success close }
    result { DONE: }
  }
}
"""
MOCK = """
memory: {force: FORCE}
skills: {arm.shut: {delay: force}}
timeline: [{after: 50, set: {arm.grip: STUCK}}]
faults: {stuck: {delay: 0.5, set: {arm.grip: STUCK}}}
"""


def make_robot(folder: Path, force: float, width: str = "float64") -> Path:
    """Make a robot with a skillset `arm`; how long its mock takes to shut it is in the mock's memory."""
    (folder / "skillsets").mkdir(parents=True)
    (folder / "robot.yaml").write_text(f"name: {folder.name}\n", encoding="utf-8")
    (folder / "skillsets" / "arm.skill").write_text(MODEL, encoding="utf-8")
    (folder / "skillsets" / "types.yaml").write_text(f"Width: {width}\n", encoding="utf-8")
    (folder / "skillsets" / "mock.yaml").write_text(MOCK.replace("FORCE", str(force)), encoding="utf-8")
    return folder


@pytest.fixture
def fleet(tmp_path: Path) -> Path:
    make_robot(tmp_path / "left", 2.0)
    make_robot(tmp_path / "right", 5.0)
    (tmp_path / "both").mkdir()
    (tmp_path / "both" / "robot.yaml").write_text("name: both\nrobots: {one: ../left, two: ../right}\n", encoding="utf-8")
    return tmp_path / "both"


def test_skillsets_of_one_name_are_told_apart_by_their_robots(fleet: Path) -> None:
    robot = load_models(load_robot_folder(fleet))
    assert [one.name for one in robot.skillsets] == ["one_arm", "two_arm"]
    assert robot.skillsets[0].skills == robot.skillsets[1].skills
    assert robot.files == {"one_arm": "skillsets/arm.skill", "two_arm": "skillsets/arm.skill"}


def test_mocks_of_a_fleet_have_memories_faults_and_times_of_their_own(fleet: Path) -> None:
    folder = load_robot_folder(fleet)
    world, robot = mock_world(load_models(folder).skillsets, behaviour_of(folder))
    one, two = (world.client(name) for name in ("one_arm", "two_arm"))
    robot.fail(parse_fault("two_stuck@1-9"))
    robot.fail(parse_fault("one_stuck@30"))
    world.run_until(lambda: one.ready and two.ready, timeout_s=10.0)
    first = one.start("shut", width=1.0)
    world.run_until(lambda: first.done, timeout_s=60.0)
    assert (first.outcome, world.now_s) == ("TERMINATED", pytest.approx(2.0, abs=0.1))
    assert (one.resources["grip"], two.resources["grip"]) == ("SHUT", "STUCK")
    assert robot.faults == {"two_stuck": pytest.approx(1.0)}
    assert robot.holds("two_arm")
    assert not robot.holds("one_arm")
    assert two.start("shut", width=1.0).get(5.0).outcome == "NOT_READY"


def test_a_behaviour_of_some_skillsets_is_so_beside_others(fleet: Path) -> None:
    behaviour = behaviour_of(load_robot_folder(fleet)).of(frozenset({"one_arm"}))
    assert [sorted(one.rules) for one in behaviour.beside] == [[("one_arm", "shut")], []]
    assert [list(one.faults) for one in behaviour.beside] == [["one_stuck"], []]


def test_types_of_one_name_have_to_be_the_same(fleet: Path) -> None:
    (fleet.parent / "right" / "skillsets" / "types.yaml").write_text("Width: float32\n", encoding="utf-8")
    with pytest.raises(LanguageError, match="type `Width` of two is float32, and that of another robot is float64"):
        load_models(load_robot_folder(fleet))


def test_interfaces_of_a_fleet_have_the_skills_of_all_robots(fleet: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    right = fleet.parent / "right" / "skillsets"
    (right / "arm.skill").write_text(MODEL.replace("skill shut", "skill open_up").replace("grip == OPEN", "grip != SHUT"), encoding="utf-8")
    out, words = tmp_path / "out", [str(fleet.parent / "left" / "skillsets"), str(right), "--interfaces"]
    assert generate([*words, "--out", str(out)]) == 0
    assert [path.name for path in out.iterdir()] == ["arm_interfaces"]
    assert sorted(path.name for path in (out / "arm_interfaces" / "action").iterdir()) == ["OpenUp.action", "Shut.action"]
    assert '"action/OpenUp.action"' in (out / "arm_interfaces" / "CMakeLists.txt").read_text(encoding="utf-8")
    (right / "arm.skill").write_text(MODEL.replace("width: Width", "far: Width"), encoding="utf-8")
    capsys.readouterr()
    assert generate([*words, "--out", str(tmp_path / "none")]) == 2
    assert "`arm_interfaces/action/Shut.action` is another action for another robot" in capsys.readouterr().err
    assert not (tmp_path / "none").exists()


@pytest.mark.parametrize(
    ("said", "complaint"),
    [
        ("robots: {one: ../nowhere}", "nowhere/robot.yaml: No such file or directory"),
        ("robots: {One: ../left}", "robot.yaml:2: `One`: a robot's name is made of a-z"),
        ("robots: {one: ../left}\nskillsets: .", "a fleet has the skillsets of its robots, and none of its own; leave `skillsets` out"),
    ],
)
def test_what_is_no_fleet_is_told_with_its_place(fleet: Path, said: str, complaint: str) -> None:
    (fleet / "robot.yaml").write_text(f"name: both\n{said}\n", encoding="utf-8")
    with pytest.raises(RobotError) as refused:
        load_robot_folder(fleet)
    assert complaint in str(refused.value)


def test_a_fleet_consists_of_robots(fleet: Path) -> None:
    (fleet.parent / "more").mkdir()
    (fleet.parent / "more" / "robot.yaml").write_text("name: more\nrobots: {both: ../both}\n", encoding="utf-8")
    with pytest.raises(RobotError, match="both is a fleet itself; name its robots"):
        load_robot_folder(fleet.parent / "more")
