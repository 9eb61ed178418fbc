"""The launch files of the scenarios, as roslaunch reads them."""

from __future__ import annotations

import re
import shlex
from collections import Counter
from pathlib import Path

import pytest
from roslaunch.config import ROSLaunchConfig, load_config_default
from uav_flight_requests import launch_arguments, parse, with_domain

from alula.common.scenarios import load_scenario, scenario_names
from uav_flight.part import Flight

LAUNCH = Path(__file__).parents[2] / "uav_bringup/launch"


def launched(scenario: str, tmp_path: Path, *arguments: str) -> ROSLaunchConfig:
    launch = LAUNCH / load_scenario(scenario).launch.removeprefix("uav_bringup/")
    return load_config_default([(str(launch), [f"out:={tmp_path}", *arguments])], None, verbose=False, assign_machines=False)


def served(config: ROSLaunchConfig) -> set[str]:
    """Return the skillsets whose managers share a process."""
    return {
        word.partition("=")[0]
        for node in config.nodes
        if node.name == "managers"
        for word in shlex.split(node.args)
        if ":make_hooks" in word
    }


@pytest.mark.parametrize("scenario", scenario_names())
def test_simulated_time_waits_only_for_nodes_that_the_scenario_starts(scenario: str, tmp_path: Path) -> None:
    config = launched(scenario, tmp_path)
    topics = [word.partition("=")[0] for word in config.params["/uav_simulator/pace_topics"].value.split(",")]
    paced = {topic.split("/")[1] for topic in topics}
    assert {"mission", "uav_guidance"} <= paced
    assert paced <= {node.name for node in config.nodes} | served(config)


@pytest.mark.parametrize("scenario", scenario_names())
def test_simulated_time_waits_for_no_manager_and_no_mission_that_come_and_go(scenario: str, tmp_path: Path) -> None:
    config = launched(scenario, tmp_path, "decision:=false", "lockstep:=false")
    paced = {word.split("/")[1] for word in config.params["/uav_simulator/pace_topics"].value.split(",")}
    assert paced <= {node.name for node in config.nodes}
    assert "uav_guidance" in paced


@pytest.mark.parametrize("scenario", scenario_names())
def test_processes_that_can_be_made_to_fail_are_nodes(scenario: str, tmp_path: Path) -> None:
    nodes = {node.name for node in launched(scenario, tmp_path).nodes}
    assert set(dict(load_scenario(scenario).processes).values()) <= nodes


@pytest.mark.parametrize("scenario", scenario_names())
def test_what_the_command_line_asks_for_reaches_the_nodes(scenario: str, tmp_path: Path) -> None:
    words = ["--autopilot", "tcp:127.0.0.1:15760", "--sensors", "simulated", "--imperfections", "realistic", "--record", "sensors"]
    words += ["--seed", "7", "--rate", "3", "--fail", "zed@30", "--world", "forest", "--out", str(tmp_path / "run")]
    spec = with_domain(parse([scenario, *words]), 77)
    config = launched(scenario, tmp_path, *launch_arguments(spec))
    given = {name.rpartition("/")[2]: param.value for name, param in config.params.items() if name.startswith("/uav_simulator/")}
    expected = {"seed": 7, "rate": 3.0, "faults": "zed@30", "vehicle": "ardupilot", "imperfections": "realistic", "world": spec.world}
    flight = Flight.of(spec)
    expected |= {"ardupilot_port": flight.body_port, "mavlink_port": flight.mavlink_port}
    assert {name: given[name] for name in expected} == expected
    assert config.params["/uav_guidance/url"].value == flight.autopilot
    (record,) = [node for node in config.nodes if node.name == "record"]
    assert "/zed/left/image_raw" in record.args


@pytest.mark.parametrize("scenario", scenario_names())
def test_where_viewers_find_the_tree_reaches_the_mission_as_text(scenario: str, tmp_path: Path) -> None:
    for words, host in ([], ""), (["--groot", "0"], "127.0.0.1:"), (["--groot", "0.0.0.0:0"], "0.0.0.0:"):
        spec = with_domain(parse([scenario, *words, "--out", str(tmp_path / "run")]), 77)
        (mission,) = [node for node in launched(scenario, tmp_path, *launch_arguments(spec)).nodes if node.name == "mission"]
        assert f"groot:='{spec.groot}'" in shlex.split(mission.args)
        assert spec.groot.startswith(host)
        assert bool(spec.groot) is bool(words)


def test_the_radios_faults_and_ports_reach_the_nodes(tmp_path: Path) -> None:
    spec = with_domain(parse(["inspection", "--fail", "radio@40", "--fail", "control@50", "--out", str(tmp_path / "run")]), 77)
    params = {name: param.value for name, param in launched("inspection", tmp_path, *launch_arguments(spec)).params.items()}
    assert params["/radio_link/faults"] == "radio@40,control@50"
    ports = [
        params[name] - Flight.of(spec).radio_port
        for name in ("/radio_link/base_port", "/ground_station/video_port", "/uav_simulator/gcs_port")
    ]
    assert ports == [0, 1, 5]


def test_an_operator_is_a_node_of_its_own_where_one_acts(tmp_path: Path) -> None:
    acts = ["--fail", "operator:pause@5-11", "--fail", "zed@30", "--fail", "operator:abort@20"]
    for words, expected in (acts, ["operator:pause@5-11,operator:abort@20"]), (["--fail", "zed@30"], []):
        spec = with_domain(parse(["mapping", *words, "--out", str(tmp_path / "run")]), 77)
        config = launched("mapping", tmp_path, *launch_arguments(spec))
        operators = [shlex.split(node.args) for node in config.nodes if node.name == "operator"]
        assert [args[args.index("--acts") + 1] for args in operators] == expected
        assert config.params["/uav_simulator/faults"].value == "zed@30"


def test_every_argument_of_a_run_is_declared_and_has_one_default(tmp_path: Path) -> None:
    """An argument reaches all files that are included: roslaunch would not tell of one that no file knows."""
    general = LAUNCH.parents[1] / "skillset_ros1/launch/decision.launch"
    texts = [path.read_text(encoding="utf-8") for path in (*LAUNCH.glob("*.launch"), general)]
    declared = {name for text in texts for name in re.findall(r'<arg name="(\w+)" (?:default="[^"]*" )?doc="[^"]+"/>', text)}
    words = ["--groot", "0", "--out", str(tmp_path / "run")]
    specs = [
        parse(["inspection", "--autopilot", "tcp:127.0.0.1:15760", *words]),
        parse(["inspection", "--fail", "operator:abort@9", *words]),
    ]
    assert {word.partition(":=")[0] for spec in specs for word in launch_arguments(spec)} <= declared
    defaults = Counter(name for text in texts for name in set(re.findall(r'<arg name="(\w+)" default=', text)))
    # Each scenario has a world of its own, and the radio has a seed, too.
    assert {name for name, count in defaults.items() if count > 1} <= {"world", "seed"}
    for text in texts:
        assert text.count("<include ") == text.count('pass_all_args="true"')
