"""What stays up between missions: commands and environments, the state of processes, what the keeper does, the disk, systemd's unit."""

from __future__ import annotations

import configparser
import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import threading
from dataclasses import replace
from pathlib import Path

import psutil
import pytest
from hypothesis import given
from hypothesis import strategies as st

from alula.common.deployments import Deployment, DeploymentError, Discovery, Page, PageUsers, Processes, load_deployment
from alula.common.errors import AlulaError
from alula.common.network import free_port
from alula.common.robots import VARIABLE as ROBOT
from alula.common.robots import find_robot
from alula.common.run_log import read_held
from alula.generate.scaffold.skeleton import files_of
from alula.report.aborts import read_abort
from alula.report.deaths import read_deaths
from alula.runtime.live.part import RunPart
from alula.runtime.live.spec import RequestError, RunSpec
from alula_flight import attached as attachments
from alula_flight import rest
from alula_flight.attached import AttachedSupervisor, PartsWatch
from alula_flight.command_line import parse
from alula_flight.outcome import is_recorded
from alula_flight.run import CANNOT_START, main
from alula_flight.station import keeper as keepers
from alula_flight.station import service as services
from alula_flight.station import state as states
from alula_flight.station.__main__ import main as commands
from alula_flight.station.contents import changes, with_contents
from alula_flight.station.disk import GB, Kept, beyond, tidy
from alula_flight.station.keeper import Kept as KeptPart
from alula_flight.station.keeper import differences, end_all, graph_of
from alula_flight.station.master import why_no_master
from alula_flight.station.notify import VARIABLE, notify
from alula_flight.station.parts import Part, Places, bridge_file, environment_of, network_profile, parts_of
from alula_flight.station.state import PartState, StationState, living, start_of
from alula_flight.station.station import Station
from alula_testing.waits import until
from alula_testing.wall_clock import WallClock

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def places(tmp_path):
    places = Places(ROOT, tmp_path / "robot/.alula", tmp_path / "robot/.alula/up/lab")
    for folder in (places.logs, places.bags, places.robot / "generated"):
        folder.mkdir(parents=True)
    return places


@pytest.fixture
def deployment(tmp_path):
    return Deployment("lab", tmp_path / "robot/deployments/lab.yaml", master="http://10.0.0.1:11311", address="10.0.0.2", domain=7)


@pytest.fixture
def robot(tmp_path, monkeypatch):
    """A new robot, and the deployment that it has."""
    root = tmp_path / "rover"
    for path, text in files_of("rover").items():
        (root / path).parent.mkdir(parents=True, exist_ok=True)
        (root / path).write_text(text, encoding="utf-8")
    monkeypatch.setenv(ROBOT, str(root))
    monkeypatch.setenv("ALULA_ROBOT_STATE", str(root / ".alula"))
    monkeypatch.setenv("ALULA_ROOT", str(ROOT))
    return root


def sleeper(**environment):
    words = (sys.executable, "-c", "import time; print('here', flush=True); time.sleep(1000)")
    return Part("bridge", words, {**os.environ, **environment})


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


def test_a_part_is_started_again_that_was_started_with_something_else(kept):
    one = kept(replace(sleeper(), contents={"skill drive": "1"}))
    turned(one, lambda: one.state.state == states.STARTING, "it is started")
    first = one.state.pid
    assert not one.differs
    one.part = replace(one.part, contents={"skill drive": "2", "skill park": "1"})
    assert one.differs
    assert differences(one.state, one.part) == ["new: skill park", "changed: skill drive"]
    one.end()
    turned(one, lambda: one.state.pid not in {0, first}, "it is started again")
    assert not one.differs


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


# --- the keeper -------------------------------------------------------------------------------------------------------


@pytest.fixture
def kept(places, monkeypatch):
    """What keeps a part up, which is started again at once."""
    monkeypatch.setattr(keepers, "AGAIN_S", 0.0)
    made = []

    def make(part):
        made.append(KeptPart(part, PartState(), places))
        return made[-1]

    yield make
    for one in made:
        one.end()


def turned(one, condition, what):
    def turn():
        one.look()
        return condition()

    until(turn, what)


def test_a_part_that_is_killed_is_started_again(kept, monkeypatch):
    monkeypatch.setattr(keepers, "LIVES_S", 0.0)
    one = kept(sleeper())
    turned(one, lambda: one.state.state == states.RUNNING, "it runs")
    first = one.state.pid
    os.kill(first, signal.SIGKILL)
    turned(one, lambda: one.state.pid not in {0, first}, "it runs again")
    assert (one.state.deaths, one.state.why.partition(":")[0]) == (1, "signal SIGKILL")


def test_a_part_that_looks_dead_before_all_of_its_threads_are_tells_how_it_ended(kept, monkeypatch):
    one = kept(sleeper())
    one.look()
    with monkeypatch.context() as looks_dead:
        looks_dead.setattr(PartState, "process", None)
        one.look()
        assert one.state.deaths == 0
        os.kill(one.state.pid, signal.SIGKILL)
        turned(one, lambda: one.state.deaths, "its end is seen")
    assert one.state.why.partition(":")[0] == "signal SIGKILL"


def test_a_part_that_says_that_it_can_not_run_is_not_started_again_until_it_is_asked_for(kept):
    one = kept(Part("bridge", (sys.executable, "-c", "import sys; print('no such file'); sys.exit(2)"), os.environ))
    turned(one, lambda: one.state.state == states.REFUSED, "it is refused")
    assert (one.state.deaths, one.state.why) == (1, "exit code 2: no such file")
    assert not one.look()
    one.forgive()
    turned(one, lambda: one.state.deaths == 2, "it has been tried once more")


def test_a_part_that_dies_again_and_again_is_given_up(kept):
    one = kept(Part("bridge", (sys.executable, "-c", "raise SystemExit(1)"), os.environ))
    turned(one, lambda: one.state.state == states.GIVEN_UP, "it is given up")
    assert one.state.deaths == keepers.DEATHS


def test_another_keeper_takes_over_what_runs_and_sees_what_is_different_by_now(kept, places):
    one = kept(sleeper(ROS_DOMAIN_ID="7"))
    one.look()
    taken = KeptPart(one.part, one.state, places)
    assert not taken.differs
    assert not taken.look()
    assert KeptPart(sleeper(ROS_DOMAIN_ID="8"), one.state, places).differs
    os.kill(one.state.pid, signal.SIGKILL)
    one._child.wait()
    taken.look()
    assert (taken.state.state, taken.state.deaths) == (states.WAITING, 1)


def test_a_log_that_has_become_long_begins_anew_and_is_kept_beside(kept, monkeypatch):
    one = kept(sleeper())
    one.log.write_text("x" * 100)
    one.cut_log()
    assert one.log.stat().st_size == 100
    monkeypatch.setattr(keepers, "LOG_BYTES", 99)
    one.cut_log()
    assert (one.log.stat().st_size, one.log.with_suffix(".1.log").stat().st_size) == (0, 100)


def test_systemd_is_told_where_it_listens_and_nobody_else(tmp_path, monkeypatch):
    monkeypatch.delenv(VARIABLE, raising=False)
    notify("READY=1")
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as systemd:
        systemd.bind(str(tmp_path / "s"))
        monkeypatch.setenv(VARIABLE, str(tmp_path / "s"))
        notify("WATCHDOG=1")
        assert systemd.recv(100) == b"WATCHDOG=1"
    notify("WATCHDOG=1")  # gone


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


# --- the command line -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--on", "rbot"], "there is no deployment 'rbot'.*did you mean `robot`"),
        (["--on", "robot", "--fail", "obstacle@1"], "--fail: is of runs with a graph of their own"),
        (["--on", "robot", "--domain", "7"], "--domain: the deployment says it"),
        (["--on", "robot", "--namespace", "x"], "--namespace: the deployment says it"),
        (["--on", "robot", "--behaviour", "x"], "add --mock"),
    ],
)
def test_what_a_run_on_what_runs_already_can_not_be(robot, words, told):
    with pytest.raises((RequestError, DeploymentError), match=told):
        parse(["patrol", *words], RunPart())


def test_a_run_is_on_the_deployment_that_its_process_belongs_to(robot, monkeypatch):
    monkeypatch.setenv("ALULA_DEPLOYMENT", "robot")
    spec = parse(["patrol"], RunPart())
    assert (spec.deployment, spec.domain, spec.master_port) == ("robot", 42, 0)


def test_a_master_that_does_not_answer_is_said_before_anything_begins(robot, capsys):
    file = robot / "deployments/robot.yaml"
    file.write_text(file.read_text().replace("127.0.0.1:11311", f"127.0.0.1:{free_port()}", 1))
    assert main(["patrol", "--on", "robot"]) == CANNOT_START
    told = capsys.readouterr().err
    assert "no ROS master at http://127.0.0.1:" in told
    assert "`ros1: master`" in told
    assert not (robot / "runs").exists()
    assert "not known" in why_no_master("http://no-such-host.invalid:11311")


NOT_HTTP, A_PAGE, NOT_FOUND = (
    b"SSH-2.0-OpenSSH_9.2p1\r\n",
    b"HTTP/1.0 200 OK\r\nContent-Type: text/html\r\n\r\n<html><p>Welcome</html>",
    b"HTTP/1.0 404 Not Found\r\nContent-Length: 0\r\n\r\n",
)


@pytest.mark.parametrize("answer", [NOT_HTTP, A_PAGE, NOT_FOUND], ids=["no HTTP", "a page", "not found"])
def test_another_program_at_the_masters_port_is_told(answer: bytes) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:

        def serve() -> None:
            connection, _ = server.accept()
            with connection:
                connection.recv(65_536)
                connection.sendall(answer)
                connection.shutdown(socket.SHUT_WR)
                while connection.recv(65_536):  # what is left unread would reset the connection
                    pass

        thread = threading.Thread(target=serve)
        thread.start()
        told = why_no_master(f"http://127.0.0.1:{server.getsockname()[1]}")
        thread.join()
    assert told == "another program than a ROS master has that port"


def test_a_mission_keeps_the_parts_from_being_changed(robot, capsys):
    station = Station("robot")
    lock = states.take(station.folder / states.MISSION_LOCK)
    states.note_holder(lock, "the mission patrol")
    for words in (["up", "robot"], ["down"]):
        assert commands(words) == CANNOT_START
        assert "the mission patrol, process" in capsys.readouterr().err
    lock.close()


def test_the_status_of_what_is_down(robot, capsys):
    assert commands(["status", "--json"]) == 1
    said = json.loads(capsys.readouterr().out)
    assert (said["deployment"], said["up"], said["domain"], said["parts"], said["mission"]) == ("robot", False, 42, {}, "")
    assert commands(["up", "robot", "--restart", "rover"]) == CANNOT_START
    assert "--restart rover: the part managers serves it" in capsys.readouterr().err
    assert commands(["up", "robot", "--restart", "brige"]) == CANNOT_START
    assert "did you mean `bridge`" in capsys.readouterr().err
    assert commands(["down"]) == 0


class Watched(RunPart):
    """Somebody else has the robot for some looks."""

    def __init__(self, looks=0):
        self.looks, self.rested = looks, 0

    def held(self, clock):
        self.looks -= 1
        return "the pilot has it, at 3.0 m" if self.looks >= 0 else ""

    def bring_to_rest(self, clock):
        self.rested += 1


def attached(robot, part, code, *, limit_s=0.0):
    """Return the supervisor of a mission on the robot's deployment that ends at once with this code."""
    out = robot / "runs/patrol"
    (out / "logs").mkdir(parents=True, exist_ok=True)
    supervisor = AttachedSupervisor(RunSpec("patrol", str(out), "id", deployment="robot", limit_s=limit_s, robot=str(robot)), part)
    supervisor._mission = lambda: (sys.executable, "-c", f"import os, signal; {code}")
    supervisor._recording = lambda: ("sleep", "100")
    supervisor._listen = lambda: None
    return supervisor


@pytest.mark.parametrize(
    ("code", "looks", "ended", "rested"),
    [("exit(0)", 0, 0, 0), ("exit(1)", 0, 1, 1), ("os.kill(os.getpid(), signal.SIGKILL)", 0, 1, 1), ("exit(0)", 9, 0, 3)],
    ids=["accomplished", "given up", "killed", "accomplished, and somebody else has it"],
)
def test_a_mission_on_what_runs_leaves_a_robot_at_rest(robot, monkeypatch, code, looks, ended, rested):
    monkeypatch.setattr(attachments, "LOOK_S", 0.01)
    monkeypatch.setattr(rest, "LOOK_S", 60.0)  # it comes to rest at once: no look is due
    part = Watched()
    supervisor = attached(robot, part, code)
    mission_of = supervisor._start

    def start(name, words):
        mission = mission_of(name, words)
        if name == "mission":
            mission.wait()
            part.looks = looks
        return mission

    monkeypatch.setattr(supervisor, "_start", start)
    assert supervisor.run() == ended
    assert part.rested >= rested if rested else part.rested == 0


def test_a_mission_on_what_runs_says_what_it_waits_for(robot, monkeypatch):
    monkeypatch.setattr(attachments, "LOOK_S", 0.01)
    monkeypatch.setattr("alula_flight.waits.TELL_HELD_S", 0.0)
    assert attached(robot, Watched(looks=4), "exit(1)").run() == 1
    said = read_held(robot / "runs/patrol")
    assert said
    assert all(how.startswith("the pilot has it, at 3.0 m, for ") for how in said)


def test_a_limit_ends_a_mission_on_what_runs_and_a_run_that_watches_on(robot, monkeypatch):
    monkeypatch.setattr(attachments, "LOOK_S", 0.01)
    supervisor = attached(robot, Watched(looks=10**9), "exit(1)", limit_s=0.3)
    assert supervisor.run() == 1
    end = read_abort(robot / "runs/patrol")
    assert end is not None
    assert end.why == "its limit of 0.3 s is over"


def test_a_part_that_ends_under_a_mission_is_in_its_record_and_earlier_ends_are_not(tmp_path):
    state = StationState(parts={"bridge": PartState(1, 1.0, states.RUNNING, deaths=4)})
    state.save(tmp_path)
    watch = PartsWatch(tmp_path, tmp_path)
    watch.look(1.0)
    state.parts["bridge"] = PartState(0, 0.0, states.WAITING, deaths=5, why="signal SIGKILL: x")
    state.save(tmp_path)
    watch.look(2.0)
    state.parts["bridge"].state = states.RUNNING
    state.save(tmp_path)
    watch.look(3.0)
    assert [(one.name, one.how, one.when_s, one.again_s) for one in read_deaths(tmp_path)] == [("bridge", "signal SIGKILL: x", 2.0, 3.0)]


# --- systemd ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("user", ["", "robo"])
def test_the_unit_keeps_the_deployment_up(robot, user):
    read = configparser.ConfigParser(strict=False, interpolation=None)
    read.optionxform = str
    read.read_string(services.unit(Station("robot"), user, os.environ))
    service = dict(read["Service"])
    assert service["ExecStart"] == f"{ROOT}/setup/in_ros1 python3 -m alula_flight.station.keeper robot"
    assert (service["Type"], service["WatchdogSec"], service["Restart"], service.get("User", "")) == ("notify", "60", "on-failure", user)
    assert service["KillMode"] == "process", "the parts outlive their keeper, and the next one takes them over"
    assert service["WorkingDirectory"] == str(robot)
    assert read["Unit"]["StartLimitBurst"] == "5"
    assert read["Install"]["WantedBy"] == ("multi-user.target" if user else "default.target")
    assert ("After" in read["Unit"]) is bool(user)


def test_systemd_reads_the_unit(robot, tmp_path):
    if shutil.which("systemd-analyze") is None:
        pytest.skip("there is no systemd-analyze on this machine")
    path = tmp_path / services.unit_name(Station("robot"))
    path.write_text(services.unit(Station("robot"), "", os.environ))
    done = subprocess.run(["systemd-analyze", "verify", "--man=no", str(path)], capture_output=True, text=True, check=False)
    assert path.name not in done.stderr, done.stderr


@pytest.mark.parametrize(
    ("word", "written"), [("/a/b", "/a/b"), ("a b", '"a b"'), ('say "x"', '"say \\"x\\""'), ("50%", "50%%"), ("$HOME", '"$$HOME"')]
)
def test_words_of_a_unit_mean_what_they_say(word, written):
    assert services.quoted(word) == written


def test_a_service_is_printed_anywhere_and_installed_where_systemd_runs(robot, capsys, monkeypatch, tmp_path):
    assert commands(["service", "--print", "robot"]) == 0
    assert capsys.readouterr().out.startswith("[Unit]\n")
    monkeypatch.setattr(services, "BOOTED", tmp_path / "no-such-folder")
    assert commands(["service", "install", "robot"]) == CANNOT_START
    assert "systemd does not run on this computer" in capsys.readouterr().err
    for words in (["robot"], ["start", "robot"], ["install"], ["--print", "install", "robot"]):
        assert commands(["service", *words]) == CANNOT_START
        assert "it takes: install DEPLOYMENT" in capsys.readouterr().err


def test_a_service_is_installed_enabled_and_removed(robot, capsys, monkeypatch, tmp_path):
    asked = tmp_path / "asked"
    control = tmp_path / "bin/systemctl"
    control.parent.mkdir()
    control.write_text(f'#!/bin/sh\necho "$@" >> {asked}\n')
    control.chmod(0o755)
    monkeypatch.setenv("PATH", f"{control.parent}:{os.environ['PATH']}")
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    monkeypatch.setattr(services, "BOOTED", tmp_path)
    name = services.unit_name(Station("robot"))
    assert commands(["service", "install", "robot"]) == 0
    assert (tmp_path / "config/systemd/user" / name).read_text().startswith("[Unit]\n")
    left = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(1000)"])
    folder = Station("robot").folder
    folder.mkdir(parents=True, exist_ok=True)
    start = states.start_of(left.pid)
    StationState(parts={"bridge": PartState(pid=left.pid, start=start, state=states.RUNNING)}).save(folder)
    assert commands(["service", "remove", "robot"]) == 0
    assert living(left.pid, start) is None, "what a keeper has left is ended"
    assert not (tmp_path / "config/systemd/user" / name).exists()
    user = ["daemon-reload", f"enable --now {name}", f"disable --now {name}", "daemon-reload"]
    assert asked.read_text().splitlines() == [f"--user {one}" for one in user]
    assert commands(["service", "remove", "robot"]) == CANNOT_START
    assert "nothing was installed" in capsys.readouterr().err
