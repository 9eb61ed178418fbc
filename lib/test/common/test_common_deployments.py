"""What the file of a deployment may say, and what is said of one that is wrong."""

from __future__ import annotations

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from alula.common.deployments import (
    KEYS,
    PAGE_KEYS,
    RECORD_KEYS,
    ROS1_KEYS,
    ROS2_KEYS,
    Deployment,
    DeploymentError,
    Discovery,
    Page,
    PageUsers,
    load_deployment,
    read_deployment,
)
from alula.common.robots import load_robot_folder
from alula.generate.scaffold.skeleton import files_of

WHOLE = """\
about: two computers
ros1: {master: "http://192.168.1.10:11311/", address: 192.168.1.20}
ros2: {domain: 7, discovery: SUBNET, peers: [192.168.1.30], namespace: rover}
managers: {base: "rover_skills.base:make", arm: ./arm, lift: "rover_skills.lift:make"}
bridge: rover_bridge.yaml
record: {topics: [/odom, /scan], disk_gb: 2.5}
page: {users: operators, address: 192.168.1.20, port: 8441}
"""
LEAST = "ros1: {master: 'http://127.0.0.1:11311'}\nros2: {}\n"


def read(folder, text):
    path = folder / "robot.yaml"
    path.write_text(text, encoding="utf-8")
    return read_deployment(path)


def test_all_that_a_file_may_say_is_read(tmp_path):
    assert read(tmp_path, WHOLE) == Deployment(
        name="robot",
        path=tmp_path / "robot.yaml",
        about="two computers",
        master="http://192.168.1.10:11311",
        address="192.168.1.20",
        domain=7,
        discovery=Discovery.SUBNET,
        peers=("192.168.1.30",),
        namespace="/rover",
        managers={"base": ("rover_skills.base:make",), "arm": ("./arm",), "lift": ("rover_skills.lift:make",)},
        bridge="rover_bridge.yaml",
        topics=("/odom", "/scan"),
        disk_gb=2.5,
        page=Page(PageUsers.OPERATORS, "192.168.1.20", 8441),
    )
    assert read(tmp_path, WHOLE).parts == ("bridge", "managers", "arm", "recorder", "page")
    assert read(tmp_path, f"{WHOLE}processes: skillsets\n").parts == ("bridge", "base", "arm", "lift", "recorder", "page")


def test_what_is_left_out_does_not_run_here_and_all_binds_to_loopback(tmp_path):
    least = read(tmp_path, LEAST)
    assert least.parts == ()
    assert (least.address, least.domain, least.discovery, least.peers) == ("127.0.0.1", 0, Discovery.LOCALHOST, ())
    assert read(tmp_path, f"{LEAST}page: {{}}\n").page == Page(PageUsers.HERE, "127.0.0.1", 8440)


@pytest.mark.parametrize(
    ("text", "line", "told"),
    [
        ("", "", "is empty; a deployment needs `ros1` and `ros2`"),
        ("ros1: {master: 'http://a:1'}\n", ":1", "a deployment needs `ros2`"),
        (f"{LEAST}silence: {{rover.estop: 4}}\n", ":3", "`silence`: the managers of rover do not run here; here run none"),
        (
            f"{LEAST}managers: {{rover: x}}\nsilence: {{estop: 4}}\n",
            ":4",
            "`estop` names no resource; write SKILLSET.RESOURCE, as rover.estop",
        ),
        (
            f"{LEAST}managers: {{rover: x}}\nsilence: {{rover.estop: 0.5}}\n",
            ":4",
            "the silence of rover.estop should be a number from 1 to 3600",
        ),
        (f"{LEAST}bridges: x\n", ":3", "a deployment has no `bridges`; it may have .*did you mean `bridge`"),
        ("ros1: {address: 10.0.0.1}\nros2: {}\n", ":1", "`ros1` needs `master`"),
        ("ros1: {master: 10.0.0.1}\nros2: {}\n", ":1", "`master` should be the URI of a ROS master"),
        ("ros1: {master: 'http://10.0.0.1:x'}\nros2: {}\n", ":1", "`master` should be the URI of a ROS master"),
        ("ros1: {master: 'http://10.0.0.1:11311'}\nros2: {}\n", ":1", "the master is on another computer"),
        ("ros1: {master: 'http://127.0.0.1:11311'}\nros2: {domains: 3}\n", ":2", "`ros2` has no `domains`"),
        ("ros1: {master: 'http://127.0.0.1:11311'}\nros2: {domain: 102}\n", ":2", "`domain` should be a number from 0 to 101"),
        ("ros1: {master: 'http://127.0.0.1:11311'}\nros2: {domain: 1.5}\n", ":2", "should be a whole number"),
        ("ros1: {master: 'http://127.0.0.1:11311'}\nros2: {discovery: SUBNETS}\n", ":2", "did you mean `SUBNET`"),
        ("ros1: {master: 'http://127.0.0.1:11311'}\nros2: {peers: [10.0.0.1]}\n", ":2", "not found with `discovery: LOCALHOST`"),
        ("ros1: {master: 'http://127.0.0.1:11311'}\nros2: {namespace: 1-2}\n", ":2", "`namespace` should be a name"),
        (f"{LEAST}managers: {{page: x}}\n", ":3", "`page` names no skillset"),
        (f"{LEAST}managers: {{managers: x}}\n", ":3", "`managers` names no skillset"),
        (f"{LEAST}managers: {{base: ''}}\n", ":3", "what serves base is empty; name the maker of its hooks"),
        (f"{LEAST}processes: many\n", ":3", "`processes` is not many; it may be single, skillsets, separate"),
        (f"{LEAST}managers: {{base: '\"x'}}\n", ":3", "the command of base: No closing quotation"),
        (f"{LEAST}record: {{topics: odom}}\n", ":3", "should be a whole name"),
        (f"{LEAST}record: {{disk_gb: 0}}\n", ":3", "`disk_gb` should be a number from 0.1"),
        (f"{LEAST}page: {{users: all}}\n", ":3", "`users` is not all; it may be here, watchers, operators"),
        (f"{LEAST}page: {{users: watchers}}\n", ":3", "needs an `address` of this computer that others reach"),
        (f"{LEAST}page: {{address: 0.0.0.0}}\n", ":3", "listens on 127.0.0.1 only"),
        (f"{LEAST}page: {{port: 0}}\n", ":3", "`port` should be a number from 1 to 65535"),
    ],
)
def test_what_is_wrong_is_said_with_its_place_and_what_would_be_right(tmp_path, text, line, told):
    with pytest.raises(DeploymentError, match=told) as raised:
        read(tmp_path, text)
    assert f"robot.yaml{line}:" in str(raised.value)
    assert "\n" not in str(raised.value)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow])
@given(
    st.text(max_size=200)
    | st.sampled_from(sorted({*KEYS, *ROS1_KEYS, *ROS2_KEYS, *RECORD_KEYS, *PAGE_KEYS})).map(lambda key: f"{key}: [1]")
)
def test_any_text_is_a_deployment_or_one_clear_error(tmp_path, text):
    told = ""
    try:
        read(tmp_path, LEAST + text)
    except DeploymentError as error:
        told = str(error)
    assert not told or "robot.yaml" in told


def test_a_name_that_is_not_there_is_refused_with_those_that_are(tmp_path):
    (tmp_path / "skillsets").mkdir()
    (tmp_path / "robot.yaml").write_text("name: rover\n")
    robot = load_robot_folder(tmp_path)
    with pytest.raises(DeploymentError, match=r"there is no deployment 'lab' in .*docs/how-to/on-the-robot.md"):
        load_deployment("lab", robot)
    (tmp_path / "deployments").mkdir()
    (tmp_path / "deployments" / "field.yaml").write_text(LEAST)
    with pytest.raises(DeploymentError, match=r"there is no deployment 'feild'.*did you mean `field`"):
        load_deployment("feild", robot)
    assert load_deployment("field", robot).name == "field"


def test_a_new_robots_deployment_runs_all_here_and_tells_every_key(tmp_path):
    text = files_of("rover")["deployments/robot.yaml"]
    made = read(tmp_path, text)
    assert made.parts == ("bridge", "managers", "recorder", "page")
    assert all(f"{key}:" in text for key in (*KEYS, *ROS1_KEYS, *ROS2_KEYS, *RECORD_KEYS, *PAGE_KEYS))
