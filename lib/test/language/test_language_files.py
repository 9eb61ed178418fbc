"""Findings about files: such as are no models, and what is wrong in a robot's folder."""

from __future__ import annotations

from pathlib import Path

import pytest

from alula.language.errors import LanguageError, Severity
from alula.language.load import check_file, load_robot, load_skillset
from alula.language.models import read_text
from alula.language.side_files import load_types
from alula.language.standard_messages import standard_messages

LINK = "resource link { initial DOWN extern DOWN -> UP extern UP -> DOWN }\n"


def codes(error) -> list[str]:
    return [finding.code for finding in error.value.diagnostics]


def test_files_that_are_no_text(tmp_path):
    missing = tmp_path / "missing.skill"
    with pytest.raises(LanguageError, match=r"missing\.skill: error ALU001: can't be read: No such file") as caught:
        load_skillset(missing)
    with pytest.raises(LanguageError, match="ALU006"):
        load_skillset(tmp_path)
    with pytest.raises(LanguageError, match="ALU001"):
        load_skillset("a\0b")
    latin = tmp_path / "latin.skill"
    latin.write_bytes("skillset s { // \xe9\n}".encode("latin-1"))
    with pytest.raises(LanguageError, match="ALU002: not UTF-8 text: byte 16 is 0xe9"):
        load_skillset(latin)
    large = tmp_path / "large.skill"
    large.write_bytes(b" " * 1_200_001)
    with pytest.raises(LanguageError, match="ALU003"):
        load_skillset(large)
    assert codes(caught) == ["ALU001"]


def test_marks_and_line_ends_of_other_systems(tmp_path):
    path = tmp_path / "dos.skill"
    path.write_bytes("\ufeffskillset s {\r\n  skill f { input { a: bool // yes\r\n } result { R } }\r\n}\r\n".encode())
    assert "\r" not in read_text(path)
    assert load_skillset(path).skill("f").inputs[0].comment == "yes"


def test_warnings_do_not_keep_a_model_from_being_loaded(tmp_path):
    path = tmp_path / "x.skill"
    path.write_text("skillset s { type P }")
    assert load_skillset(path).name == "s"
    assert [d.code for d in check_file(path)[1]] == ["ALU303"]


def test_findings_of_the_check_carry_their_line(tmp_path):
    path = tmp_path / "x.skill"
    path.write_text(f"skillset s {{\n  {LINK}  skill f {{ progress = 0 result {{ R }} }}\n}}")
    with pytest.raises(LanguageError, match=r"x\.skill:3:13: error ALU211") as caught:
        load_skillset(path)
    assert "    3 |   skill f { progress = 0 result { R } }" in str(caught.value)


def robot(folder, skill="skillset s { }", types=None, bindings=None):
    (folder / "s.skill").write_text(skill)
    for name, text in (("types.yaml", types), ("bindings.yaml", bindings)):
        if text is not None:
            (folder / name).write_bytes(text.encode() if isinstance(text, str) else text)
    return folder


def test_a_folder_without_skillsets(tmp_path):
    with pytest.raises(LanguageError, match=r"ALU006: no \*\.skill or \*\.rl file in it"):
        load_robot(tmp_path)
    with pytest.raises(LanguageError, match="ALU006: is no folder"):
        load_robot(tmp_path / "none")


def test_a_robot_with_all_that_can_be_wrong_tells_all(tmp_path):
    robot(tmp_path, "skillset s { type Lost data d: Lost }", "Lst: nosuch", "data: {s.e: /x}\ncolour: red")
    (tmp_path / "t.skill").write_text("skillset s { }")
    with pytest.raises(LanguageError) as caught:
        load_robot(tmp_path)
    assert sorted(codes(caught)) == ["ALU005", "ALU005", "ALU401", "ALU402", "ALU403", "ALU404"]
    assert "did you mean `s.d`?" in str(caught.value)


def test_roles_are_those_of_all_skillsets_of_a_folder(tmp_path):
    (tmp_path / "s.skill").write_text("skillset s { skill go { needs eyes result { DONE } } }")
    (finding,) = check_file(tmp_path / "s.skill")[1]
    assert (finding.code, finding.severity, finding.span.column) == ("ALU307", Severity.WARNING, 31)
    (tmp_path / "t.rl").write_text("skillset t { skill watch { provides eyes failure lost } }")
    assert check_file(tmp_path / "s.skill")[1] == []  # also when that one is not named
    (tmp_path / "u.rl").write_text("skillset u { skill look { provides eyes success seen } }")
    with pytest.raises(LanguageError) as caught:
        load_robot(tmp_path)
    found = [(Path(one.span.file).name, one.code, one.message) for one in caught.value.diagnostics]
    assert found == [
        ("t.rl", "ALU229", "`watch` provides `eyes` while it runs, and `look` once it has succeeded"),
        ("u.rl", "ALU229", "`look` provides `eyes` once it has succeeded, and `watch` while it runs"),
    ]


def test_data_that_no_topic_can_carry(tmp_path):
    robot(tmp_path, "skillset s { type Path data d: Path }", "Path: geometry_msgs/Point[]", "data: {s.d: /d}")
    with pytest.raises(LanguageError, match="ALU405: data `d` is a list"):
        load_robot(tmp_path)


@pytest.mark.parametrize(
    ("types", "bindings", "message"),
    [
        ("[1, 2]", "", "should be a mapping at its top"),
        ("a: [", "", "can't be read"),
        (b"\xff\xfe\x00", "", "can't be read"),
        ("Point: 3", "", "type `Point` is 3"),
        ("Point: geometry_msgs", "", "type `Point` is 'geometry_msgs'"),
        ("", "data: [1]", "`data` should map"),
        ("", "data: {s.d: 1}", "data.s.d should be a mapping, not 1"),
        ("", "data: {s.d: {topic: relative}}", "`topic` is 'relative'; it should be an absolute ROS name"),
        ("", "data: {s.d: {}}", "data.s.d has no `topic`"),
        ("", "topics: {}", "`topics` should be a list"),
        ("", "topics: [{name: /a, direction: up, type: std_msgs/Header}]", "`direction` is 'up'; it should be ros1_to_ros2"),
        ("", "topics: [{name: /a, direction: [], type: std_msgs/Header}]", "`direction` is []"),
        ("", "topics: [{name: /a, direction: ros1_to_ros2, type: std_msgs/msg/Header}]", "it should be package/Name"),
        ("", "topics: [{name: /a, direction: ros1_to_ros2, type: std_msgs/Header, deph: 3}]", "unknown key `deph`"),
        ("", "topics: [{name: /a, direction: ros1_to_ros2, type: std_msgs/Header, depth: 0}]", "`depth` is 0"),
        ("", "topics: [{name: /a, direction: ros1_to_ros2, type: std_msgs/Header, reliability: no}]", "should be reliable or best_effort"),
        ("", "services: [{name: /a, server: ros1, type: std_srvs/SetBool, timeout_s: -1}]", "`timeout_s` is -1"),
        ("", "services: [{name: /a, type: std_srvs/SetBool}]", "services[0] has no `server`"),
        ("", "service: []", "unknown section `service`; there are `data`, `topics`, `services`, `actions`"),
        ("", "actions: [{name: /a, server: ros1}]", "actions[0] has no `type`"),
        ("", "actions: [{name: /a, server: ros1, type: move_base_msgs/MoveBase, latched: true}]", "unknown key `latched`"),
    ],
)
def test_side_files(tmp_path, types, bindings, message):
    robot(tmp_path, types=types, bindings=bindings)
    with pytest.raises(LanguageError) as caught:
        load_robot(tmp_path)
    assert "ALU005" in codes(caught)
    assert message in str(caught.value)


def test_a_message_that_a_package_of_each_ros_does_not_have_is_told_without_ros(tmp_path, monkeypatch):
    path = tmp_path / "types.yaml"
    path.write_text("Seen: sensor_msgs/LaserScn\nGoal: geometry_msgs/PoseStamped\nRoute: uav_msgs/Route\nNew: nav_msgs/Later\n")
    shared = tmp_path / "ros" / "share" / "nav_msgs" / "msg"
    shared.mkdir(parents=True)
    (shared / "Later.msg").write_text("int32 x\n")
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path / "ros"))
    types, (finding,) = load_types(path)
    assert (finding.code, finding.message) == ("ALU005", "type `Seen` is sensor_msgs/LaserScn, and sensor_msgs has no message `LaserScn`")
    assert finding.hint == "did you mean `LaserScan`?"
    assert {"Goal", "Route", "New"} <= set(types)


def test_the_names_of_standard_messages_are_those_of_ros():
    """By the definitions of another project: of ROS 1 and of each ROS 2 that it knows."""
    typesys = pytest.importorskip("rosbags.typesys")
    found: dict[str, set[str]] = {}
    for store in typesys.Stores:
        for name in typesys.get_typestore(store).types:
            package, kind, *rest = name.split("/")
            if package in standard_messages() and kind == "msg":
                found.setdefault(package, set()).update(rest)
    assert {package: set(names) for package, names in standard_messages().items()} == found
