"""A flight in a container for each world: what each starts, and wrong input."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest
import ruamel.yaml

ALULA_ROOT = Path(__file__).resolve().parents[1]
LAUNCH = "ros1_ws/src/uav_bringup/launch"


def run(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(words, cwd=ALULA_ROOT, capture_output=True, text=True, timeout=60, check=False)


@pytest.mark.parametrize("scenario", ["mapping", "inspection"])
def test_the_functional_world_starts_nothing_of_ros_2(scenario: str, tmp_path: Path) -> None:
    nodes = {
        decision: set(
            run(
                "setup/in_ros1", "roslaunch", "--nodes", f"{LAUNCH}/{scenario}.launch", f"out:={tmp_path}", f"decision:={decision}"
            ).stdout.split()
        )
        for decision in ("true", "false")
    }
    assert {"/uav_simulator", "/uav_guidance", "/record"} <= nodes["false"]
    assert {"/ros_bridge", "/mission", "/navigation"} <= nodes["true"] - nodes["false"]


@pytest.mark.parametrize("scenario", ["mapping", "inspection"])
def test_compose_starts_each_world_once_where_the_others_find_it(scenario: str) -> None:
    with (ALULA_ROOT / "docker" / f"{scenario}.yaml").open(encoding="utf-8") as file:
        services = ruamel.yaml.YAML(typ="safe").load(file)["services"]
    assert {name: service["command"] for name, service in services.items()} == {
        world: [world, scenario] for world in ("functional", "bridge", "skills")
    }
    for name in ("functional", "bridge"):  # ROS 1 nodes tell peers the name under which these reach them
        assert services[name]["environment"]["ROS_HOSTNAME"] == name
    assert {service["environment"]["ROS_MASTER_URI"] for service in services.values()} == {"http://functional:11311"}


MODULES = "import importlib.util, sys; sys.exit(' '.join(one for one in sys.argv[1:] if importlib.util.find_spec(one) is None) or 0)"
PARSED = "import sys, rclpy.utilities as ros; from skillset_ros2.mission import parse; print(parse(ros.remove_ros_args(sys.argv)[1:]))"


@pytest.mark.parametrize("scenario", ["mapping", "inspection"])
def test_what_the_skills_world_starts_is_there_and_takes_its_words(scenario: str, tmp_path: Path) -> None:
    """The commands are noted by a checkout whose ``setup/in_ros2`` runs nothing; its mission ends after the managers have begun."""
    checkout, noted, begun = tmp_path / "alula", tmp_path / "noted", tmp_path / "begun"
    os.mkfifo(begun)
    for folder in ("docker", "setup"):
        (checkout / folder).mkdir(parents=True)
    shutil.copy(ALULA_ROOT / "docker/world", checkout / "docker/world")
    for name in ("setup/places.sh", "scenarios"):
        (checkout / name).symlink_to(ALULA_ROOT / name)
    handed = f'case "$3" in *.managers) echo begun > {begun} ;; *) read -r _ < {begun} ;; esac'
    (checkout / "setup/in_ros2").write_text(f'#!/bin/sh\necho "$*" >> {noted}\n{handed}\n', encoding="utf-8")
    (checkout / "setup/in_ros2").chmod(0o755)
    words, environment = [str(checkout / "docker/world"), "skills", scenario], {**os.environ, "OUT": str(tmp_path / "out")}
    done = subprocess.run(words, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    commands = {words[2]: words[3:] for words in (line.split() for line in noted.read_text(encoding="utf-8").splitlines())}
    assert set(commands) == {"skillset_ros2.managers", "skillset_ros2.mission"}
    hooks = [word.partition("=")[2].partition(":")[0] for word in commands["skillset_ros2.managers"] if word.endswith(":make_hooks")]
    assert len(hooks) == 3
    found = run("setup/in_ros2", "python", "-c", MODULES, *commands, *hooks)
    assert (found.returncode, found.stderr) == (0, "")
    parsed = run("setup/in_ros2", "python", "-c", PARSED, *commands["skillset_ros2.mission"])
    assert (parsed.returncode, parsed.stderr) == (0, "")
    assert f"scenario='{scenario}'" in parsed.stdout


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (("docker/world", "nosuch", "mapping"), "nosuch"),
        (("docker/world", "bridge", "nosuch"), "nosuch"),
        (("docker/build", "nosuch"), "nosuch"),
    ],
)
def test_wrong_input_is_exit_code_2_and_names_it(words: tuple[str, ...], named: str) -> None:
    done = run(*words)
    assert done.returncode == 2
    assert named in done.stderr


@pytest.mark.parametrize(
    ("given", "base"),
    [
        ({}, "docker.io/library/debian:bookworm-slim"),
        ({"SUITE": "trixie"}, "docker.io/library/debian:trixie-slim"),
        ({"SUITE": "trixie", "BASE": "localhost/mine"}, "localhost/mine"),
    ],
)
def test_images_are_built_on_the_suite_or_base_that_is_asked_for(tmp_path: Path, given: dict[str, str], base: str) -> None:
    engine = tmp_path / "buildah"
    engine.write_text('#!/bin/sh\necho "$*"\n', encoding="utf-8")
    engine.chmod(0o755)
    environment = {key: value for key, value in os.environ.items() if key not in {"SUITE", "BASE"}}
    environment |= {"ENGINE": "buildah", "PATH": f"{tmp_path}:{os.environ['PATH']}"} | given
    done = subprocess.run(["docker/build", "fly"], cwd=ALULA_ROOT, env=environment, capture_output=True, text=True, check=True)
    assert f"--build-arg BASE={base} --target fly " in done.stdout


def test_a_host_name_of_the_caller_is_not_joined_by_a_loopback_address() -> None:
    """Roscpp rejects peers by name beside ROS_IP=127.0.0.1."""
    environment = {key: value for key, value in os.environ.items() if key not in {"ROS_IP", "ROS_HOSTNAME"}}
    shown = {
        name: subprocess.run(
            ["setup/in_ros1", "sh", "-c", "echo ${ROS_IP:-none}"],
            cwd=ALULA_ROOT,
            env=environment | given,
            capture_output=True,
            text=True,
            check=True,
        ).stdout.strip()
        for name, given in {"alone": {}, "named": {"ROS_HOSTNAME": "functional"}}.items()
    }
    assert shown == {"alone": "127.0.0.1", "named": "none"}
