"""What stays up between missions: the environments and contents of its parts, the state of processes, the disk."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import psutil
import pytest
from hypothesis import given
from hypothesis import strategies as st
from station_rig import ROOT, sleeper

from alula.common.deployments import DeploymentError, Discovery, Page, PageUsers, Processes, load_deployment
from alula.common.errors import AlulaError
from alula.common.robots import find_robot
from alula.runtime.live.spec import RunSpec
from alula_flight.outcome import is_recorded
from alula_flight.station import state as states
from alula_flight.station.__main__ import main as commands
from alula_flight.station.contents import changes, with_contents
from alula_flight.station.disk import GB, Kept, beyond, tidy
from alula_flight.station.keeper import end_all, graph_of
from alula_flight.station.parts import Places, bridge_file, environment_of, network_profile, parts_of
from alula_flight.station.state import PartState, StationState, living, start_of
from alula_flight.station.station import Station
from alula_testing.wall_clock import WallClock

# --- commands and environments ----------------------------------------------------------------------------------------


def test_all_parts_are_in_the_graph_that_the_deployment_names_and_not_in_the_callers(deployment, places):
    caller = {
        "ROS_MASTER_URI": "http://a:1",
        "ROS_HOSTNAME": "a",
        "ROS_DOMAIN_ID": "1",
        "NOTIFY_SOCKET": "/x",
        "ALULA_RUN_ID": "id",
        "LANG": "C",
    }
    known = environment_of(
        replace(deployment, peers=("10.0.0.3", "10.0.0.4"), discovery=Discovery.SUBNET, namespace="/rover"), places, caller
    )
    graph = {name: value for name, value in known.items() if name.startswith(("ROS_", "ALULA_", "NOTIFY"))}
    assert graph == {
        "ROS_MASTER_URI": "http://10.0.0.1:11311",
        "ROS_IP": "10.0.0.2",
        "ROS_DOMAIN_ID": "7",
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET",
        "ROS_STATIC_PEERS": "10.0.0.3;10.0.0.4",
        "ROS_HOME": str(places.logs),
        "ROS_LOG_DIR": str(places.logs),
        "ALULA_NAMESPACE": "/rover",
        "ALULA_DEPLOYMENT": "lab",
    }
    assert known["LANG"] == "C"
    assert known["FASTRTPS_DEFAULT_PROFILES_FILE"] == str(places.folder / "fastdds.xml")
    by_name = environment_of(replace(deployment, address="decision.local"), places, caller)
    assert (by_name["ROS_HOSTNAME"], "ROS_IP" in by_name, "FASTRTPS_DEFAULT_PROFILES_FILE" in by_name) == ("decision.local", False, False)


def test_missions_of_the_page_are_not_the_deployments_to_end(deployment, places):
    whole = replace(deployment, managers={"base": ("python", "-m", "x")}, topics=("/odom",), page=Page(PageUsers.WATCHERS, "10.0.0.2", 80))
    parts = {part.name: part for part in parts_of(whole, places, "id", {})}
    assert list(parts) == list(whole.parts) == ["base", "recorder", "page"]
    assert {name: part.environment.get("ALULA_RUN_ID") for name, part in parts.items()} == {"base": "id", "recorder": "id", "page": None}
    assert parts["page"].words[-5:] == ("--host", "10.0.0.2", "--port", "80", "--plain")


def test_managers_are_told_the_silences_that_the_deployment_gives_their_resources(deployment, places):
    managers = {"base": ("python", "-m", "x"), "base2": ("python", "-m", "y")}
    given = replace(deployment, managers=managers, silences={"base.link": 4.0, "base2.estop": 1.5})
    parts = {part.name: part.words for part in parts_of(given, places, "id", {})}
    assert parts["base"][-5:] == ("x", "--ros-args", "-p", "silence.base.link:=4.0", "__name:=base")
    assert parts["base2"][-4:] == ("--ros-args", "-p", "silence.base2.estop:=1.5", "__name:=base2")


@pytest.mark.parametrize(
    ("processes", "words"),
    [
        (Processes.SINGLE, {"managers": "managers base=b:make arm=a:make --ros-args -p silence.arm.link:=4.0"}),
        (Processes.SKILLSETS, {"base": "managers base=b:make", "arm": "managers arm=a:make --ros-args -p silence.arm.link:=4.0"}),
        (
            Processes.SEPARATE,
            {
                "base": "managers base=b:make --processes separate",
                "arm": "managers arm=a:make --processes separate --ros-args -p silence.arm.link:=4.0",
            },
        ),
    ],
)
def test_managers_whose_hooks_maker_is_named_share_as_many_processes_as_the_deployment_says(deployment, places, processes, words):
    managers = {"base": ("b:make",), "gripper": ("./gripper",), "arm": ("a:make",)}
    given = replace(deployment, managers=managers, processes=processes, silences={"arm.link": 4.0})
    parts = {part.name: " ".join(part.words) for part in parts_of(given, places, "id", {})}
    assert parts.keys() == set(given.parts) == {*words, "gripper"}
    for part, said in words.items():
        assert parts[part].endswith(f"in_ros2 python -m skillset_ros2.{said} __name:={part}")
    assert parts["gripper"].endswith("in_ros2 ./gripper __name:=gripper")


def test_a_silence_of_what_has_none_in_its_model_begins_nothing(robot, capsys):
    path = robot / "deployments/robot.yaml"
    text = path.read_text(encoding="utf-8")
    path.write_text(f"{text}\nsilence: {{rover.lnk: 4}}\n", encoding="utf-8")
    assert commands(["up", "robot"]) == 2
    assert "`silence`: rover.lnk has no `silence` in its model; did you mean `rover.link`?" in capsys.readouterr().err
    assert not (robot / ".alula/up/robot" / states.FILE).exists()


def test_a_run_is_recorded_unless_its_deployment_records_nothing(robot):
    path = robot / "deployments/robot.yaml"
    said = path.read_text(encoding="utf-8")
    assert is_recorded(RunSpec("patrol", "/out", "id"))
    assert is_recorded(RunSpec("patrol", "/out", "id", deployment="robot")), "its scaffold records some topics"
    path.write_text(re.sub(r"^record:.*(\n .*)*", "", said, flags=re.MULTILINE), encoding="utf-8")
    assert not is_recorded(RunSpec("patrol", "/out", "id", deployment="robot"))
    path.write_text("nonsense: 1", encoding="utf-8")
    assert is_recorded(RunSpec("patrol", "/out", "id", deployment="robot"))


def test_the_bridges_configuration_is_the_robots_file_or_what_set_up_has_generated(deployment, places):
    named = replace(deployment, bridge="rover_bridge.yaml")
    (places.robot / "generated/other_bridge.yaml").touch()
    with pytest.raises(DeploymentError, match=r"there is no rover_bridge.yaml .*\(other_bridge.yaml\)"):
        bridge_file(named, places)
    (places.robot / "generated/rover_bridge.yaml").touch()
    assert bridge_file(named, places) == places.robot / "generated/rover_bridge.yaml"
    own = named.path.parent.parent / "rover_bridge.yaml"
    own.touch()
    assert bridge_file(named, places) == own


@pytest.mark.parametrize(("address", "bound"), [("10.0.0.2", ["127.0.0.1", "10.0.0.2"]), ("decision.local", [])])
def test_dds_binds_to_the_address_of_the_deployment_besides_loopback(deployment, address, bound):
    ours = (ROOT / "bridge/fastdds.xml").read_text(encoding="utf-8")
    profile = network_profile(replace(deployment, address=address), ours)
    assert re.findall(r"<address>(.*?)</address>", profile) == bound
    assert "<segment_size>67108864</segment_size>" in profile


# --- what a part was started with -------------------------------------------------------------------------------------


BRIDGE_YAML = ".alula/generated/rover_bridge.yaml"
CONTENTS = st.dictionaries(st.sampled_from("abcde"), st.sampled_from("xyz"))


@given(before=CONTENTS, now=CONTENTS)
def test_each_piece_that_differs_is_named_once_and_no_other(before, now):
    told = [name for line in changes(before, now) for name in line.partition(": ")[2].split(", ")]
    assert sorted(told) == sorted(name for name in {*before, *now} if before.get(name) != now.get(name))


def edited(path, old, new):
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new), encoding="utf-8")


def pieces(robot):
    """Return the contents of a new robot's parts by their names."""
    deployment = load_deployment("robot", find_robot(robot))
    places = Places(ROOT, robot / ".alula", robot / ".alula/up/robot")
    generated = robot / BRIDGE_YAML
    if not generated.exists():
        generated.parent.mkdir(parents=True)
        generated.write_text("topics:\n- {name: /rover/odom, depth: 5}\n- {name: /rover/cmd_vel, depth: 5}\n", encoding="utf-8")
    parts = with_contents(parts_of(deployment, places, "id", {}), deployment, places, find_robot(robot))
    return {part.name: part.contents for part in parts}


@pytest.mark.parametrize(
    ("path", "old", "new", "part", "told"),
    [
        ("skillsets/rover.skill", "silence = 2.0", "silence = 3.0", "managers", ["changed: resource link of rover"]),
        ("skillsets/rover.skill", "STUCK: apply", "JAMMED: apply", "managers", ["changed: skill drive of rover, skill back_off of rover"]),
        ("skillsets/rover.skill", "resource bumper", "resource bumper2", "managers", None),
        ("skillsets/bindings.yaml", "/rover/odom", "/rover/odometry", "managers", ["changed: binding of rover.odometry"]),
        (
            "ros2_ws/src/rover_robot/rover_robot/hooks.py",
            "SILENT_AFTER_S = ",
            "SILENT_AFTER_S = 1 + ",
            "managers",
            ["changed: ros2_ws/src/rover_robot/rover_robot/hooks.py"],
        ),
        ("skillsets/rover.skill", "// Drives straight on.", "// Drives on.", "managers", []),
        (BRIDGE_YAML, "cmd_vel, depth: 5", "cmd_vel, depth: 9", "bridge", ["changed: topic /rover/cmd_vel"]),
        (
            ".alula/generated/rover_bridge.yaml",
            "name: /rover/cmd_vel",
            "name: /x",
            "bridge",
            ["new: topic /x", "gone: topic /rover/cmd_vel"],
        ),
    ],
)
def test_a_change_of_a_model_a_binding_or_a_hook_is_named_by_what_it_is(robot, path, old, new, part, told):
    before = pieces(robot)
    assert changes(before[part], pieces(robot)[part]) == []
    edited(robot / path, old, new)
    if told is None:
        with pytest.raises(AlulaError, match="bumper"):
            pieces(robot)
        return
    now = pieces(robot)
    assert changes(before[part], now[part]) == told
    assert [name for name in now if name != part and now[name] != before[name]] == []


def test_what_runs_is_compared_with_what_is_here_now(robot):
    before = pieces(robot)["managers"]
    station = Station("robot")
    assert station.differences() == {}, "nothing runs"
    words = {part.name: part for part in parts_of(station.deployment, station.places, "id", os.environ)}
    me = {"pid": os.getpid(), "start": start_of(os.getpid())}
    runs = PartState(**me, words=words["managers"].words, graph=graph_of(words["managers"]), contents=before)
    station.folder.mkdir(parents=True)
    StationState("id", parts={"managers": runs}).save(station.folder)
    assert station.differences() == {}
    edited(robot / "skillsets/rover.skill", "silence = 2.0", "silence = 3.0")
    assert station.differences() == {"managers": ["changed: resource link of rover"]}


# --- processes and their state ----------------------------------------------------------------------------------------


def test_a_process_is_known_by_its_start_as_ids_are_used_again(tmp_path):
    me, start = psutil.Process(), start_of(os.getpid())
    boot, ticks = start.split()
    assert living(me.pid, start) == me
    assert living(me.pid, f"{boot} {int(ticks) - 500}") is None
    assert living(me.pid, f"another-{boot} {ticks}") is None, "after a reboot ids and ticks may be the same"
    assert living(0, "") is None
    state = StationState(
        "id", 5, "boot 6", 7, "full", {"bridge": PartState(1, "boot 2", states.RUNNING, ("a", "b"), {"ROS_IP": "x"}, 3, "why")}
    )
    state.save(tmp_path)
    assert StationState.load(tmp_path) == state
    for text in ("", "{}", '{"parts": {"x": {}}}', "[]"):
        (tmp_path / states.FILE).write_text(text)
        assert StationState.load(tmp_path).parts == {}


@pytest.mark.parametrize("by_s", [3600, -3600])
def test_a_process_is_known_to_another_one_whose_wall_clock_was_set_since(tmp_path, by_s):
    clock = WallClock(tmp_path)
    clock.step(by_s)
    asked = f"from alula_flight.station.state import living; print(living({os.getpid()}, {start_of(os.getpid())!r}) is not None)"
    done = subprocess.run([sys.executable, "-c", asked], env=clock.environment, capture_output=True, text=True, check=True)
    assert done.stdout == "True\n"


def test_a_lock_is_held_as_long_as_its_process_lives(tmp_path):
    path = tmp_path / "x/mission.lock"
    assert states.holder(path) == ""
    lock = states.take(path)
    states.note_holder(lock, "the mission patrol")
    assert states.take(path) is None
    assert states.holder(path) == f"the mission patrol, process {os.getpid()}"
    lock.close()
    assert states.holder(path) == ""


def test_what_a_keeper_that_died_has_left_is_ended_and_nothing_else(places):
    ours, theirs = (subprocess.Popen(sleeper().words, start_new_session=True, stdout=subprocess.PIPE) for _ in range(2))
    try:
        for one in (ours, theirs):
            one.stdout.readline()
        reused = PartState(theirs.pid, "another-boot 1", states.RUNNING)
        state = StationState(parts={"bridge": PartState(ours.pid, start_of(ours.pid), states.RUNNING), "page": reused})
        end_all(state)
        assert ours.poll() is not None
        assert theirs.poll() is None
        assert {part.state for part in state.parts.values()} == {states.ENDED}
    finally:
        for one in (ours, theirs):
            one.kill()
            one.wait()


# --- the disk ---------------------------------------------------------------------------------------------------------


@given(st.lists(st.tuples(st.floats(0, 1e9), st.integers(0, 10**12)), max_size=8), st.integers(0, 10**13))
def test_the_oldest_go_until_the_rest_fits_and_the_newest_stays(known, budget):
    kept = [Kept(Path(str(number)), written_s, size) for number, (written_s, size) in enumerate(known)]
    gone = beyond(kept, budget)
    left = [one for one in kept if one not in gone]
    assert max((one.written_s for one in gone), default=0.0) <= min((one.written_s for one in left), default=1e9)
    assert len(left) == 1 or sum(one.size for one in left) <= budget
    assert not gone or sum(one.size for one in [*left, gone[-1]]) > budget


def test_only_finished_missions_of_the_deployment_and_its_recordings_go(tmp_path):
    runs, bags = tmp_path / "runs", tmp_path / "bags"
    bags.mkdir()
    for number, (name, owner, finished) in enumerate(
        [("mine", "lab", True), ("theirs", "field", True), ("flying", "lab", False), ("newest", "lab", True)]
    ):
        (runs / name).mkdir(parents=True)
        (runs / name / "run.json").write_text(json.dumps({"deployment": owner}))
        if finished:
            (runs / name / "summary.json").write_text("x" * 1000)
        for path in (runs / name).iterdir():
            os.utime(path, (number + 10, number + 10))
    (bags / "a.bag").write_bytes(b"x" * 1000)
    os.utime(bags / "a.bag", (1, 1))
    told = tidy(runs, bags, "lab", 1100 / GB)
    assert sorted(path.name for path in [*runs.iterdir(), *bags.iterdir()]) == ["flying", "newest", "theirs"]
    assert "the oldest go next" in told
