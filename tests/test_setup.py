"""What set-up installs: pins for each version of Python that a supported system has, and what a given ROS lacks."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
from collections.abc import Iterable
from importlib.metadata import Distribution
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from alula_testing.cover import cover

ALULA_ROOT = Path(__file__).resolve().parents[1]
PYTHONS = [(3, 11), (3, 12), (3, 13)]  # Debian 12, Ubuntu 24.04, Debian 13


def load(name: str) -> ModuleType:
    """Import a script of set-up, which is no module of a package."""
    spec = importlib.util.spec_from_file_location(name, ALULA_ROOT / f"setup/{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = sys.modules[name] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


sync_packages, given_ros = load("sync_packages"), load("given_ros")


def test_a_pin_holds_for_the_versions_of_python_that_it_names(tmp_path: Path) -> None:
    pins = tmp_path / "pins.txt"
    pins.write_text('# comment\nA_b==1.0\nc==1 ; python_version < "3.12"\nc==2 ; python_version >= "3.12"  # why\n', encoding="utf-8")
    assert [sync_packages.read_pins(pins, python) for python in PYTHONS] == [
        {"a-b": "1.0", "c": "1"},
        {"a-b": "1.0", "c": "2"},
        {"a-b": "1.0", "c": "2"},
    ]


def test_an_unknown_condition_is_refused_by_name(tmp_path: Path) -> None:
    pins = tmp_path / "pins.txt"
    pins.write_text('c==1 ; sys_platform == "linux"\n', encoding="utf-8")
    with pytest.raises(SystemExit, match='sys_platform == "linux"'):
        sync_packages.read_pins(pins)


@pytest.mark.parametrize("world", ["ros1", "ros2", "jazzy"])
def test_every_version_of_python_gets_the_same_packages(world: str) -> None:
    pins = [sync_packages.read_pins(ALULA_ROOT / "setup" / f"{world}.txt", python) for python in PYTHONS]
    assert pins[0].keys() == pins[1].keys() == pins[2].keys()


@pytest.mark.parametrize("world", [1, 2])
def test_compiled_modules_are_kept_although_a_container_image_says_otherwise(world: int) -> None:
    command = [f"{ALULA_ROOT}/setup/in_ros{world}", "python", "-c", "import sys; print(sys.dont_write_bytecode)"]
    environment = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1"}
    assert subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout.strip() == "False"


@pytest.mark.parametrize(
    ("world", "flies", "builds"),
    [("ros1", "open3d-cpu", "pytest"), ("ros2", "rosbags", "colcon-core"), ("jazzy", "ros-jazzy-rclpy", "ros-ament-cmake-core")],
)
def test_an_image_that_flies_has_no_package_that_only_builds_or_tests(world: str, flies: str, builds: str) -> None:
    every, runtime = (sync_packages.read_pins(ALULA_ROOT / "setup" / f"{world}.txt", runtime=only) for only in (False, True))
    assert {flies, builds} <= every.keys()
    assert runtime.items() < every.items()
    assert flies in runtime
    assert builds not in runtime


def add_wheel(site: Path, name: str, *files: str) -> Distribution:
    """Put a distribution into a folder as pip does, with its record of files."""
    info = site / f"{name}-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n", encoding="utf-8")
    (info / "INSTALLER").write_text("pip\n", encoding="utf-8")
    (info / "RECORD").write_text("".join(f"{file},sha256=x,1\n" for file in files), encoding="utf-8")
    for file in files:
        (site / file).parent.mkdir(exist_ok=True)
        (site / file).touch()
    return Distribution.at(info)


def test_a_package_with_a_missing_file_is_not_whole(tmp_path: Path) -> None:
    wheel = add_wheel(tmp_path, "ros_rclpy", "rclpy/__init__.py", "rclpy/node.py", "rclpy/node.pyc")
    (tmp_path / "rclpy/node.pyc").unlink()
    assert sync_packages.whole(wheel)
    (tmp_path / "rclpy/node.py").unlink()
    assert not sync_packages.whole(wheel)


def test_what_a_wheel_carries_of_another_name_is_no_package_to_remove(tmp_path: Path) -> None:
    """The wheel of ros-rclpy holds the egg-info of rclpy: to uninstall that would take the wheel's own files away."""
    add_wheel(tmp_path, "ros_rclpy", "rclpy/__init__.py")
    add_wheel(tmp_path, "leftover", "leftover.py")
    egg_info = tmp_path / "rclpy-1.0-py3.11.egg-info"
    egg_info.mkdir()
    (egg_info / "PKG-INFO").write_text("Metadata-Version: 2.1\nName: rclpy\nVersion: 1.0\n", encoding="utf-8")
    assert sync_packages.removable({"ros-rclpy": "1.0"}, tmp_path) == ["leftover"]


def test_a_system_is_judged_by_what_it_has_and_not_by_its_name(tmp_path: Path) -> None:
    """Ubuntu 24.04 carries the same packages."""
    release = tmp_path / "os-release"
    release.write_text('ID=ubuntu\nID_LIKE=debian\nVERSION_ID="24.04"\nPRETTY_NAME="Ubuntu 24.04.3 LTS"\n', encoding="utf-8")
    commands = f"mount --bind {release} /etc/os-release && ./alula setup && ./alula doctor"
    done = subprocess.run([*cover(tmp_path), "sh", "-c", commands], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "Alula is ready" in done.stderr
    assert "Ubuntu 24.04.3 LTS" in done.stdout


LISTS = {"1": "apt.txt", "2": "jazzy.txt"}


def lines_of(world: str) -> list[str]:
    """Return the list of what Alula installs of a world's ROS, as it is."""
    return (ALULA_ROOT / "setup" / LISTS[world]).read_text(encoding="utf-8").splitlines()


def packages_asked_for(world: str) -> set[str]:
    """Return the ROS packages that a ROS must have for Alula to need no other."""
    if world == "1":
        return {line.split()[1] for line in lines_of(world) if not line.startswith("#") and " " in line}
    return {line.partition("==")[0][len("ros-jazzy-") :].replace("-", "_") for line in lines_of(world) if line.startswith("ros-jazzy-")}


def add_prefix(prefix: Path, packages: Iterable[str]) -> Path:
    """Make an install space with the manifests of some packages."""
    for package in packages:
        (prefix / "share" / package).mkdir(parents=True)
        (prefix / "share" / package / "package.xml").touch()
    return prefix


def installed_of_ros(given: Any, world: str) -> list[str]:
    """Return what set-up would install of ROS, without versions."""
    lines = [line for line in given_ros.to_install(given, lines_of(world)) if not line.startswith("#")]
    return [line.split()[0].partition("==")[0] for line in lines if given_ros.package_of(world, line)]


@pytest.mark.parametrize("world", ["1", "2"])
def test_where_no_ros_or_a_part_of_one_is_given_all_of_it_is_installed(tmp_path: Path, world: str) -> None:
    absent = given_ros.Given(world, ())
    assert not absent.whole
    assert given_ros.to_install(absent, lines_of(world)) == lines_of(world)
    drivers = add_prefix(tmp_path, {"camera_driver", *sorted(given_ros.WHOLE[world])[1:]})
    part = given_ros.Given(world, (drivers,), "jazzy")
    assert not part.whole
    assert given_ros.to_install(part, lines_of(world)) == lines_of(world)


@pytest.mark.parametrize("world", ["1", "2"])
def test_beside_a_whole_ros_no_other_is_installed_and_what_is_not_of_ros_stays(tmp_path: Path, world: str) -> None:
    prefixes = (
        add_prefix(tmp_path / "overlay", {"camera_driver"}),
        add_prefix(tmp_path / "ros", packages_asked_for(world) | {*given_ros.WHOLE[world], "genpy"}),
    )
    given = given_ros.Given(world, prefixes, "kilted")
    assert given.whole
    assert given.root == tmp_path / "ros"
    assert installed_of_ros(given, world) == []
    kept = given_ros.to_install(given, lines_of(world))
    assert kept == [line for line in lines_of(world) if not given_ros.package_of(world, line) or line.startswith("#")]
    assert "# Only to build and to test (left out of images that fly):" in kept


@pytest.mark.parametrize(
    ("world", "lacks", "installed"),
    [
        ("1", "tf2_ros", ["python3-tf2-ros"]),
        ("1", "std_msgs", ["python3-std-msgs", "ros-std-msgs", "libstd-msgs-dev"]),
        ("2", "stereo_msgs", ["ros-jazzy-stereo-msgs", "ros-stereo-msgs"]),
    ],
)
def test_just_what_a_whole_ros_lacks_is_installed(tmp_path: Path, world: str, lacks: str, installed: list[str]) -> None:
    ros = add_prefix(tmp_path, (packages_asked_for(world) | {*given_ros.WHOLE[world], "genpy"}) - {lacks})
    assert installed_of_ros(given_ros.Given(world, (ros,), "jazzy"), world) == installed


def test_what_a_newer_ros_lacks_is_said_since_there_are_wheels_of_jazzy_only(tmp_path: Path) -> None:
    ros = add_prefix(tmp_path, (packages_asked_for("2") | {*given_ros.WHOLE["2"]}) - {"stereo_msgs"})
    with pytest.raises(given_ros.GivenRosError, match=r"'kilted' and lacks stereo_msgs.* install ros-kilted-stereo-msgs"):
        given_ros.to_install(given_ros.Given("2", (ros,), "kilted"), lines_of("2"))


def test_a_ros_of_another_python_is_refused(tmp_path: Path) -> None:
    ros = given_ros.Given("2", (add_prefix(tmp_path, given_ros.WHOLE["2"]),), "jazzy")
    python = tmp_path / "lib/python3.12/site-packages"
    (python / "rclpy").mkdir(parents=True)
    given_ros.check_python(ros, [python], (3, 11))
    (python / "rclpy/_rclpy_pybind11.cpython-312-x86_64-linux-gnu.so").touch()
    given_ros.check_python(ros, [python], (3, 12))
    with pytest.raises(given_ros.GivenRosError, match=rf"in {tmp_path} is for Python 3.12, and this system's is 3.11"):
        given_ros.check_python(ros, [python], (3, 11))


def add_underlay(prefix: Path, world: str, packages: Iterable[str]) -> Path:
    """Make an install space that can be sourced."""
    add_prefix(prefix, packages)
    name = {"1": "CMAKE_PREFIX_PATH", "2": "AMENT_PREFIX_PATH"}[world]
    (prefix / "setup.bash").write_text(f'export {name}="{prefix}${{{name}:+:${name}}}" ROS_DISTRO=jazzy\n', encoding="utf-8")
    return prefix


def decide(state: Path, robot: Path) -> subprocess.CompletedProcess[str]:
    """Have set-up decide what of ROS is to be installed, in an installation of its own that has this one's Python."""
    if not state.exists():
        (state / "stamps").mkdir(parents=True)
        (state / "stamps/venv2").touch()
        (state / "venv2").symlink_to(Path(os.environ["ALULA_STATE"]) / "venv2")
    environment = {**os.environ, "ALULA_STATE": str(state), "ALULA_ROBOT": str(robot)}
    command = [str(ALULA_ROOT / "setup/setup.sh"), "--quiet", "--only", "given"]
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)


def wheels_of(state: Path) -> list[str]:
    """Return the wheels of ROS that an installation is to have."""
    lines = (state / "wheels.txt").read_text(encoding="utf-8").splitlines()
    return [line.partition("==")[0] for line in lines if not line.startswith("#")]


def add_robot(folder: Path, *underlays: Path) -> Path:
    """Make a robot on top of some underlays of ROS 2."""
    folder.mkdir()
    (folder / "robot.yaml").write_text(f"name: {folder.name}\nros2: {{underlays: [{', '.join(map(str, underlays))}]}}\n", encoding="utf-8")
    return folder


def test_an_installation_stands_on_the_ros_of_the_robot_it_is_made_for_until_a_robot_brings_none(tmp_path: Path) -> None:
    every = packages_asked_for("2") | {*given_ros.WHOLE["2"]}
    jazzy = add_underlay(tmp_path / "jazzy", "2", every - {"stereo_msgs"})
    drivers, other = add_underlay(tmp_path / "drivers", "2", {"camera_driver"}), add_underlay(tmp_path / "other", "2", every)
    rover, twin = add_robot(tmp_path / "rover", jazzy, drivers), add_robot(tmp_path / "twin", jazzy)
    alien, bare = add_robot(tmp_path / "alien", other), add_robot(tmp_path / "bare")
    state = tmp_path / "state"

    assert decide(state, rover).returncode == 0
    assert wheels_of(state) == ["ros-jazzy-stereo-msgs", "ros-stereo-msgs"]
    given = (state / "given2.env").read_text(encoding="utf-8")
    assert f"ALULA_UNDERLAYS={jazzy}\n" in given, "the drivers are the rover's"
    assert (state / "given1.env").read_text(encoding="utf-8") == ""
    assert decide(state, twin).returncode == 0
    assert (state / "given2.env").read_text(encoding="utf-8") == given

    refused = decide(state, alien)
    assert refused.returncode == 2
    assert f"stands on the ROS 2 of another robot's underlays: set ALULA_STATE to another folder for {alien}" in refused.stderr
    assert (state / "given2.env").read_text(encoding="utf-8") == given

    add_prefix(jazzy, {"stereo_msgs"})
    assert decide(state, rover).returncode == 0
    assert wheels_of(state) == []

    assert decide(state, bare).returncode == 0
    assert "ros-rclpy" in wheels_of(state)
    for robot in (rover, alien, bare):
        assert decide(state, robot).returncode == 0
        assert "ros-rclpy" in wheels_of(state), "an installation that has a ROS of its own keeps it"
