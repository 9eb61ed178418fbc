"""What set-up installs: pins for each version of Python that a supported system has, whatever the version that runs here."""

from __future__ import annotations

import importlib.util
import subprocess
from importlib.metadata import Distribution
from pathlib import Path
from types import ModuleType

import pytest

from alula_testing.cover import cover

ALULA_ROOT = Path(__file__).resolve().parents[1]
PYTHONS = [(3, 11), (3, 12), (3, 13)]  # Debian 12, Ubuntu 24.04, Debian 13


def load_sync_packages() -> ModuleType:
    """Import the script of set-up, which is no module of a package."""
    spec = importlib.util.spec_from_file_location("sync_packages", ALULA_ROOT / "setup/sync_packages.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


sync_packages = load_sync_packages()


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


@pytest.mark.parametrize("world", ["ros1", "ros2"])
def test_every_version_of_python_gets_the_same_packages(world: str) -> None:
    pins = [sync_packages.read_pins(ALULA_ROOT / "setup" / f"{world}.txt", python) for python in PYTHONS]
    assert pins[0].keys() == pins[1].keys() == pins[2].keys()


@pytest.mark.parametrize(("world", "flies", "builds"), [("ros1", "open3d-cpu", "pytest"), ("ros2", "ros-jazzy-rclpy", "colcon-core")])
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
