"""What is built again when something has changed, and what a robot whose models have errors can still do."""

from __future__ import annotations

import importlib
import os
import signal
import subprocess
from pathlib import Path
from types import ModuleType

import pytest

from alula_testing.waits import until

ALULA_ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture
def workspace(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """Return ``setup/workspace.py`` as a module."""
    monkeypatch.syspath_prepend(ALULA_ROOT / "setup")
    return importlib.import_module("workspace")


def package(folder: Path, build_file: str, *needs: str) -> Path:
    folder.mkdir(exist_ok=True)
    depends = "".join(f"<depend>{name}</depend>" for name in needs)
    (folder / "package.xml").write_text(f"<package><name>{folder.name}</name>{depends}</package>")
    (folder / build_file).touch()
    return folder


def test_an_interface_that_changes_is_built_again_with_what_is_compiled_against_it_and_nothing_else(workspace, tmp_path):
    folders = [
        package(tmp_path / "interfaces", "CMakeLists.txt"),
        package(tmp_path / "more_interfaces", "CMakeLists.txt", "interfaces"),
        package(tmp_path / "managers", "setup.py", "interfaces"),
        package(tmp_path / "robot", "setup.py", "managers", "interfaces"),
    ]

    def states() -> dict[str, str]:
        packages = dict(workspace.read_package(folder) for folder in folders)
        return {name: workspace.state_of(name, packages) for name in packages}

    before = states()
    (tmp_path / "interfaces" / "Rest.action").write_text("---\n---\n")
    after = states()
    assert {name for name in before if before[name] != after[name]} == {"interfaces", "more_interfaces"}


MESSAGES_CMAKE = """cmake_minimum_required(VERSION 3.16)
project({name})
find_package(catkin REQUIRED COMPONENTS message_generation {needs})
add_message_files(FILES M.msg)
generate_messages(DEPENDENCIES {needs})
catkin_package(CATKIN_DEPENDS message_runtime {needs})
"""


def message_package(folder: Path, message: str, *needs: str) -> None:
    """Make a ROS 1 package with one message, ``M``."""
    (folder / "msg").mkdir(parents=True)
    (folder / "msg" / "M.msg").write_text(message)
    (folder / "CMakeLists.txt").write_text(MESSAGES_CMAKE.format(name=folder.name, needs=" ".join(needs)))
    depends = "".join(f"<depend>{name}</depend>" for name in ("message_generation", "message_runtime", *needs))
    (folder / "package.xml").write_text(
        f'<package format="2"><name>{folder.name}</name><version>0.1.0</version><description>A message.</description>'
        '<maintainer email="developers@alula.example.org">Alula</maintainer><license>Apache-2.0</license>'
        f"<buildtool_depend>catkin</buildtool_depend>{depends}</package>"
    )


def test_one_more_message_of_ros_1_configures_and_builds_its_package_and_those_that_need_it_only(tmp_path):
    sources, state = tmp_path / "ros1_ws/src", tmp_path / ".alula"
    (tmp_path / "robot.yaml").write_text("name: three\n")
    message_package(sources / "below", "int32 number\n")
    message_package(sources / "above", "below/M below\n", "below")
    message_package(sources / "beside", "int32 number\n")
    in_robot = ["env", f"ALULA_ROBOT={tmp_path}", f"{ALULA_ROOT}/setup/in_ros1"]
    devel = state / "ros1/devel"

    def try_to_build() -> subprocess.CompletedProcess[str]:
        command = [*in_robot, "python3", f"{ALULA_ROOT}/setup/build_ros1.py", "robot"]
        return subprocess.run(command, capture_output=True, text=True, check=False)

    def build() -> str:
        done = try_to_build()
        assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
        return done.stdout.splitlines()[0]

    def fields(name: str) -> str:
        ask = f"from {name}.msg import M; print(*M.__slots__, *M()._slot_types)"
        path = f"PYTHONPATH={devel}/lib/python3/dist-packages"
        return subprocess.run([*in_robot, "env", path, "python3", "-c", ask], capture_output=True, text=True, check=True).stdout.strip()

    def configured_ns() -> dict[str, int]:
        return {name: (devel / f"share/{name}/cmake/{name}Config.cmake").stat().st_mtime_ns for name in ("below", "above", "beside")}

    def add(name: str) -> None:
        with (sources / name / "msg/M.msg").open("a") as message:
            message.write("string more\n")

    assert build() == "to build: above below beside"
    first = configured_ns()
    assert build() == "to build: nothing"
    add("above")
    assert build() == "to build: above"
    assert fields("above") == "below more below/M string"
    second = configured_ns()
    assert {name for name in first if first[name] != second[name]} == {"above"}
    add("below")
    assert build() == "to build: above below"
    assert fields("below") == "number more int32 string"
    assert fields("above") == "below more below/M string"
    assert configured_ns()["beside"] == first["beside"]
    (sources / "beside/msg/M.msg").write_text("int32 number\nint32 number\n")
    assert try_to_build().returncode != 0
    assert try_to_build().stdout.splitlines()[0] == "to build: beside", "it was not built"


def test_a_robot_whose_models_have_errors_can_be_checked_and_keeps_no_other_from_working(tmp_path):
    (tmp_path / "skillsets").mkdir()
    (tmp_path / "robot.yaml").write_text("name: broken\n")
    (tmp_path / "skillsets/b.skill").write_text("skillset broken { resource door { initial SHUT SHUT -> -> OPEN } }\n")
    environment = {name: value for name, value in os.environ.items() if name not in {"PYTHONPATH", "ROS_DOMAIN_ID", "ALULA_ROBOT"}}

    def alula(*words: str) -> subprocess.CompletedProcess[str]:
        command = [str(ALULA_ROOT / "alula"), *words]
        return subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False, env=environment)

    checked = alula("check")
    assert (checked.returncode, "skillsets/b.skill:1:" in checked.stdout, "^" in checked.stdout) == (1, True, True), checked
    refused = alula("mock")
    assert (refused.returncode, refused.stdout) == (2, ""), refused
    assert "skillsets/b.skill:1:" in refused.stderr
    assert alula("setup", "--robot", str(ALULA_ROOT)).returncode == 0


def test_robots_packages_are_found_as_colcon_and_catkin_find_them_but_for_alulas(workspace, tmp_path, monkeypatch):
    (tmp_path / "ros2_ws/src/drivers/below").mkdir(parents=True)
    package(tmp_path / "ros2_ws/src/drivers/camera", "setup.py")
    package(tmp_path / "ros2_ws/src/drivers/below/laser", "CMakeLists.txt")
    package(tmp_path / "ros2_ws/src/skillset_interfaces", "CMakeLists.txt")
    (tmp_path / "ros2_ws/src/left_out").mkdir()
    (tmp_path / "ros2_ws/src/left_out/COLCON_IGNORE").touch()
    package(tmp_path / "ros2_ws/src/left_out/old", "setup.py")
    (tmp_path / "robot.yaml").write_text("name: nested\n")
    monkeypatch.setenv("ALULA_ROBOT", str(tmp_path))
    monkeypatch.setenv("ALULA_ROBOT_STATE", str(tmp_path / ".alula"))
    built = workspace.robots_workspace("2")
    assert set(built.packages) == {"camera", "laser"}
    assert set(built.below) == {"skillset_interfaces", "tf2_msgs", "ros_bridge", "ros_bridge_native", "skillset_ros2", "skill_panel"}


SETUP_PY = """from setuptools import setup
setup(name="{name}", version="0.1.0", packages=["{name}"], data_files=[
    ("share/ament_index/resource_index/packages", ["resource/{name}"]), ("share/{name}", ["package.xml"])])
"""


def python_package(folder: Path) -> None:
    """Make a ROS 2 package with one module."""
    name = folder.name
    for place in (name, "resource"):
        (folder / place).mkdir(parents=True)
    (folder / name / "__init__.py").write_text("RATE_HZ = 30\n")
    (folder / "resource" / name).touch()
    (folder / "setup.py").write_text(SETUP_PY.format(name=name))
    (folder / "package.xml").write_text(
        f'<package format="3"><name>{name}</name><version>0.1.0</version><description>A driver.</description>'
        '<maintainer email="developers@alula.example.org">Alula</maintainer><license>Apache-2.0</license>'
        "<export><build_type>ament_python</build_type></export></package>"
    )


INTERFACES_CMAKE = """cmake_minimum_required(VERSION 3.16)
project(counts)
find_package(ament_cmake REQUIRED)
find_package(rosidl_default_generators REQUIRED)
rosidl_generate_interfaces(counts "msg/Count.msg")
ament_package()
"""


@pytest.mark.timeout(0)  # builds a package of messages twice: as long as the machine needs
def test_messages_whose_build_was_killed_are_built_anew(tmp_path):
    folder, build = tmp_path / "ros2_ws/src/counts", tmp_path / ".alula/ros2/build/counts"
    (folder / "msg").mkdir(parents=True)
    (tmp_path / "robot.yaml").write_text("name: killed\n")
    (folder / "msg/Count.msg").write_text("int32 number\n")
    (folder / "CMakeLists.txt").write_text(INTERFACES_CMAKE)
    (folder / "package.xml").write_text(
        '<package format="3"><name>counts</name><version>0.1.0</version><description>A number.</description>'
        '<maintainer email="developers@alula.example.org">Alula</maintainer><license>Apache-2.0</license>'
        "<buildtool_depend>ament_cmake</buildtool_depend><buildtool_depend>rosidl_default_generators</buildtool_depend>"
        "<member_of_group>rosidl_interface_packages</member_of_group><export><build_type>ament_cmake</build_type></export></package>"
    )
    command = ["env", f"ALULA_ROBOT={tmp_path}", f"{ALULA_ROOT}/setup/in_ros2", "python3", f"{ALULA_ROOT}/setup/build_ros2.py", "robot"]
    killed = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)
    header = build / "rosidl_generator_c/counts/msg/detail/count__struct.h"
    until(lambda: header.exists() or killed.poll() is not None, "code is generated", timeout_s=300.0)
    os.killpg(killed.pid, signal.SIGKILL)
    assert killed.wait() == -signal.SIGKILL
    header.write_text("")  # as far as it had come
    again = subprocess.run(command, capture_output=True, text=True, check=False)
    assert again.returncode == 0, again.stdout[-3000:] + again.stderr[-3000:]
    assert "to build: counts" in again.stdout
    assert "to build: nothing" in subprocess.run(command, capture_output=True, text=True, check=True).stdout


def test_what_is_being_built_counts_as_not_built(workspace, tmp_path):
    before = workspace.Built("gcc 12", {"interfaces": "1", "robot": "1"})
    before.without(["interfaces"]).write(tmp_path / "built.json")
    # Also where its sources become again what they were before the build that was killed.
    assert workspace.Built.read(tmp_path / "built.json").changed({"interfaces": "1", "robot": "1"}) == ["interfaces"]


@pytest.mark.timeout(0)  # builds three packages: as long as the machine needs
def test_workspaces_of_others_lie_below_a_robot_that_names_them(tmp_path):
    message_package(tmp_path / "drivers1/src/driver_msgs", "int32 number\n")
    python_package(tmp_path / "drivers2/src/driver")
    robot = tmp_path / "robot"
    message_package(robot / "ros1_ws/src/robot_msgs", "driver_msgs/M below\n", "driver_msgs")
    (robot / "robot.yaml").write_text("name: upper\nros1: {underlays: [../drivers1]}\nros2: {underlays: [../drivers2]}\n")
    venv2 = Path(os.environ["ALULA_STATE"]) / "venv2"

    def run(path: str, *command: str, place: Path = robot, **more: str) -> str:
        environment = {"PATH": path, "HOME": str(tmp_path), "ALULA_STATE": os.environ["ALULA_STATE"], **more}
        done = subprocess.run(command, cwd=place, env=environment, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
        return done.stdout.strip()

    plain = "/usr/bin:/bin"
    run(plain, "catkin_make", "-DPYTHON_EXECUTABLE=/usr/bin/python3", place=tmp_path / "drivers1", CMAKE_PREFIX_PATH="/usr")
    run(f"{venv2}/bin:{plain}", "colcon", "build", place=tmp_path / "drivers2", AMENT_PREFIX_PATH=str(venv2), ROS_VERSION="2")
    run(plain, str(ALULA_ROOT / "alula"), "setup")
    named = {"ALULA_ROBOT": str(robot)}
    ask1 = "import rospkg; from robot_msgs.msg import M; print(M._slot_types[0], rospkg.RosPack().get_path('driver_msgs'))"
    said = run(plain, f"{ALULA_ROOT}/setup/in_ros1", "python3", "-c", ask1, **named)
    assert said == f"driver_msgs/M {tmp_path}/drivers1/src/driver_msgs"
    ask2 = "import driver, ament_index_python as a, rclpy; print(driver.RATE_HZ, a.get_package_share_directory('driver'))"
    said = run(plain, f"{ALULA_ROOT}/setup/in_ros2", "python3", "-c", ask2, **named)
    assert said == f"30 {tmp_path}/drivers2/install/driver/share/driver"
