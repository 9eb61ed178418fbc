"""A flight in a container for each world: what each starts, and wrong input."""

from __future__ import annotations

import os
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
