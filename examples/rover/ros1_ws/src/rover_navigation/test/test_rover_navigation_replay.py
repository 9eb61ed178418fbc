"""Recorded measurements through the cores of localisation and health, as a replay from sensors has them: what they say of a drive."""

from __future__ import annotations

import json
import math
import subprocess
import sys

import pytest
import rosbag
from actionlib_msgs.msg import GoalID, GoalStatus
from alula import parts
from move_base_msgs.msg import MoveBaseActionGoal, MoveBaseActionResult
from rover_navigation_rig import WORLDS
from std_msgs.msg import Bool, Float32

from rover_simulator import messages
from rover_simulator.simulation import Simulation
from rover_simulator.world import load_world

WORLD = WORLDS / "office.yaml"
CARRIED_S, SEARCHED_S, TURN_RAD_S, END_S = 5.0, 8.0, 0.8, 18.0
INITIAL = {"base.base_status": "DOCKED", "base.authority": "MISSION", "perception.bumper_status": "OK", "power.charger": "OFF"}


def write(bag, topic, message, simulation):
    bag.write(topic, message, messages.ros_time(simulation.now_ns))


def searched(bag, simulation, *, ends):
    """Record that a search began, or how it ended by itself."""
    goal, now = GoalID(id="search"), messages.ros_time(simulation.now_ns)
    if ends:
        result = MoveBaseActionResult(status=GoalStatus(goal, GoalStatus.ABORTED, "as it was then"))
        bag.write("/localize/result", result, now)
    else:
        bag.write("/localize/goal", MoveBaseActionGoal(goal_id=goal), now)


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    """A rover that leaves its dock, is carried away, and turns round once: its measurements, a search, and what nodes said then."""
    path = tmp_path_factory.mktemp("drive") / "functional.bag"
    simulation = Simulation(load_world(WORLD), seed=1, faults=parts.parse_faults(f"pose:lost@{CARRIED_S}"))
    with rosbag.Bag(str(path), "w") as bag:
        for step in range(round(END_S / 0.05)):
            simulation.step()
            now_s, now_ns = simulation.now_s, simulation.now_ns
            turning = SEARCHED_S < now_s < SEARCHED_S + math.tau / TURN_RAD_S + 0.5
            simulation.wheels.command(-0.3 if now_s < CARRIED_S else 0.0, TURN_RAD_S if turning else 0.0, now_s)
            odometry = messages.odometry(simulation.wheels.odometry, simulation.wheels.odometry_speed, now_ns, "odom")
            measured = [("/odom", odometry)]
            if step % 2 == 0:
                # A recorder has connections of its own: it may take the odometry of a moment before its scan.
                measured.insert(step // 2 % 2, ("/scan", messages.scan(simulation.sweep(), now_ns)))
            if step % 20 == 0:
                measured.append(("/battery_state", messages.battery(simulation.battery, now_ns)))
            for topic, message in [*measured, ("/bumper", Bool(simulation.bumper)), ("/localization/quality", Float32(0.0))]:
                write(bag, topic, message, simulation)
            if step in {round(SEARCHED_S / 0.05), round((END_S - 0.5) / 0.05)}:
                searched(bag, simulation, ends=now_s > END_S - 1.0)
    return path


def perceived(source, target, *words, world=WORLD):
    options = ["--initial", json.dumps(INITIAL), "--zero", "1", *(["--world", str(world)] if world else []), *words]
    command = [sys.executable, "-m", "node_core.replay", str(source), str(target), *options]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def told(source, target, *words):
    """Return what is reported now, ``{(resource, state): s}`` with the first time of each, and the new bag's messages."""
    done = perceived(source, target, *words)
    assert done.returncode == 0, done.stderr
    with rosbag.Bag(str(target)) as bag:
        everything = [(topic, data, t.to_nsec()) for topic, (_, data, *_), t in bag.read_messages(raw=True)]
        calls = [json.loads(message.data) for _, message, _ in bag.read_messages(topics=["/calls"])]
    states = {}
    for call in calls:
        skillset = call["service"].split("/")[1]
        states.setdefault((f"{skillset}.{call['request']['resource']}", call["request"]["to"]), call["end_s"])
    return states, everything


def test_it_notices_that_it_was_carried_and_finds_itself_and_twice_the_same(drive, tmp_path):
    states, everything = told(drive, tmp_path / "first.bag")
    assert told(drive, tmp_path / "second.bag")[1] == everything
    assert list(states) == [
        ("perception.laser", "OK"),
        ("base.pose_status", "GOOD"),
        ("power.charger", "ON"),
        ("base.base_status", "AWAY"),
        ("power.charger", "OFF"),
        ("base.pose_status", "LOST"),
    ]
    assert CARRIED_S < states["base.pose_status", "LOST"] < SEARCHED_S
    with rosbag.Bag(str(tmp_path / "first.bag")) as bag:
        results = [message.status for _, message, _ in bag.read_messages(topics=["/localize/result"])]
        poses = [message.pose.pose.position for _, message, _ in bag.read_messages(topics=["/localization/pose"])]
        qualities = [message.data for _, message, _ in bag.read_messages(topics=["/localization/quality"])]
    # The search's end is what comes of it now, told once.
    assert [(one.goal_id.id, one.status) for one in results] == [("search", GoalStatus.SUCCEEDED)]
    world = load_world(WORLD)
    assert math.dist((poses[-1].x, poses[-1].y), world.kidnapped[:2]) < 0.1
    assert min(qualities) > 0.0  # of now: then it was 0
    assert max(qualities) > 0.9


@pytest.mark.parametrize("how", ["dead", "frozen", "covered"])
def test_a_laser_that_failed_is_noticed(drive, tmp_path, how):
    states, _ = told(drive, tmp_path / "again.bag", "--fail", f"laser:{how}@2")
    assert 3.0 < states["perception.laser", "BROKEN"] < 4.2


def test_a_bumper_that_stuck_is_noticed(drive, tmp_path):
    states, _ = told(drive, tmp_path / "again.bag", "--fail", "bumper@1")
    assert 2.0 < states["perception.bumper_status", "STUCK"] < 5.0


@pytest.mark.parametrize(
    ("words", "world", "complaint"),
    [
        (("--fail", "wheels@1"), WORLD, "there is no 'wheels' to break; choose one of"),
        (("--set", "health.far=1"), WORLD, "--set health.far=1: no parameter of a node can be set here"),
        ((), None, "it tells the world, and so the map"),
        ((), WORLDS / "none.yaml", "is no world with a map and a dock"),
    ],
)
def test_a_wrong_request_is_told_in_a_line(drive, tmp_path, words, world, complaint):
    done = perceived(drive, tmp_path / "none.bag", *words, world=world)
    assert done.returncode == 2
    assert complaint in done.stderr
    assert done.stderr.count("\n") == 1
