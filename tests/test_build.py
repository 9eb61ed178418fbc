"""What is built again when something has changed, and which robots a model with errors keeps from working."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

from alula_testing.cover import cover

ALULA_ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture
def build_ros2(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> ModuleType:
    """Return ``setup/build_ros2.py`` as a module."""
    monkeypatch.setenv("ALULA_ROOT", str(ALULA_ROOT))
    monkeypatch.setenv("ALULA_STATE", str(tmp_path))
    spec = importlib.util.spec_from_file_location("build_ros2", ALULA_ROOT / "setup" / "build_ros2.py")
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, "build_ros2", module)
    spec.loader.exec_module(module)
    return module


def package(folder: Path, build_file: str, *needs: str) -> Path:
    folder.mkdir(exist_ok=True)
    depends = "".join(f"<depend>{name}</depend>" for name in needs)
    (folder / "package.xml").write_text(f"<package><name>{folder.name}</name>{depends}</package>")
    (folder / build_file).touch()
    return folder


def test_an_interface_that_changes_is_built_again_with_what_is_compiled_against_it_and_nothing_else(build_ros2, tmp_path):
    folders = [
        package(tmp_path / "interfaces", "CMakeLists.txt"),
        package(tmp_path / "more_interfaces", "CMakeLists.txt", "interfaces"),
        package(tmp_path / "managers", "setup.py", "interfaces"),
        package(tmp_path / "robot", "setup.py", "managers", "interfaces"),
    ]

    def states() -> dict[str, str]:
        packages = dict(build_ros2.read_package(folder) for folder in folders)
        return {name: build_ros2.state_of(name, packages) for name in packages}

    before = states()
    (tmp_path / "interfaces" / "Rest.action").write_text("---\n---\n")
    after = states()
    assert {name for name in before if before[name] != after[name]} == {"interfaces", "more_interfaces"}


def test_a_robot_whose_models_have_errors_is_left_out_and_named_and_keeps_no_other_from_working(tmp_path):
    broken = (
        "mkdir -p skillsets/broken && echo 'skillset broken { resource door { initial SHUT SHUT -> -> OPEN } }' > skillsets/broken/b.skill"
    )
    covered = cover(tmp_path)
    environment = {name: value for name, value in os.environ.items() if name not in {"PYTHONPATH", "ROS_DOMAIN_ID"}}

    def run(command: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run([*covered, "sh", "-c", command], capture_output=True, text=True, check=False, env=environment)

    assert run(broken).returncode == 0
    checked = run("./alula check skillsets/broken/b.skill")
    assert (checked.returncode, "skillsets/broken/b.skill:1:" in checked.stdout, "^" in checked.stdout) == (1, True, True), checked
    assert run("./alula check --no-proofs skillsets/uav/mapping.skill").returncode == 0
    listed = run("./alula skills --json")
    assert "the robot 'broken' is left out" in listed.stderr, listed.stderr
    assert "no skillset runs" in listed.stderr, listed.stderr
    assert listed.stdout == ""
