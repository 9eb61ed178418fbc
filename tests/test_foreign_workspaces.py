"""Alula's packages in workspaces of others: built by plain colcon and catkin_make, with nothing of set-up; and what their manifests say."""

from __future__ import annotations

import ast
import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

ALULA_ROOT = Path(__file__).resolve().parents[1]
STATE = Path(os.environ["ALULA_STATE"])
VENV2 = STATE / "venv2"
INTERFACES, LIBRARY = ALULA_ROOT / "bridge/interfaces/skillset_interfaces", ALULA_ROOT / "lib"
DEBIAN = {"yaml": "yaml", "cv2": "opencv", "PIL": "pil", "tf2_ros": "tf2-ros", "irsim": "ir-sim"}
"""Debian's packages by module, where they are called otherwise; `python3-` comes before."""
PIP = {"aiortc", "av", "gtsam", "irsim", "mcap", "plyfile", "py_trees", "pymavlink", "rosbags", "textual"}
"""What set-up has from PyPI; rosdep's names of such end in `-pip`."""
OF_PYPI = {"yaml": "PyYAML", "z3": "z3-solver", "py_trees": "py-trees", "lsprotocol": "pygls", "zmq": "pyzmq"}
ROS = re.compile(r"rclpy|rospy|roslib|rosgraph|rosbag|genpy|actionlib|alula|dynamic_reconfigure|\w+_(msgs|srvs|interfaces|managers)")
STUBS = {"_typeshed"}
"""What only a type checker imports."""
ONE_FILE_A_LIBRARY = r"""
function(read_headers_once)
  get_property(targets DIRECTORY PROPERTY BUILDSYSTEM_TARGETS)
  foreach(target IN LISTS targets)
    get_target_property(kind ${target} TYPE)
    if(kind STREQUAL "SHARED_LIBRARY")
      set_target_properties(${target} PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE 0)
      get_target_property(sources ${target} SOURCES)
      list(FILTER sources INCLUDE REGEX "__description\\.c$")  # two that hold a third type each define its hash
      set_source_files_properties(${sources} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
    endif()
  endforeach()
endfunction()
cmake_language(DEFER CALL read_headers_once)
"""
"""Has the compiler read ROS's headers once a library, which takes most of the time; the same libraries are built of the same sources."""
LAUNCHED = re.compile(r"\$\(find (\w+)\)|pkg=\"(\w+)\"")


def copy(workspace: Path, *packages: Path) -> Path:
    """Return a workspace with copies of packages, as somebody clones them."""
    for package in packages:
        shutil.copytree(package, workspace / "src" / package.name, ignore=shutil.ignore_patterns("test", "__pycache__", "*.egg-info"))
    return workspace


def build(workspace: Path, environment: dict[str, str], *command: str) -> None:
    plain = {"PATH": "/usr/local/bin:/usr/bin:/bin", "HOME": str(workspace), **environment}
    done = subprocess.run(command, cwd=workspace, env=plain, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-3000:]


def imported_from(path: Path, python: str, *modules: str) -> list[Path]:
    """Return the files that modules are imported from with a path in front."""
    ask = f"import importlib\nfor name in {modules!r}: print(importlib.import_module(name).__file__)"
    environment = {"PYTHONPATH": str(path), "PATH": os.environ["PATH"], "LD_LIBRARY_PATH": os.environ.get("LD_LIBRARY_PATH", "")}
    done = subprocess.run([python, "-c", ask], env=environment, capture_output=True, text=True, check=True)
    return [Path(line) for line in done.stdout.split()]


@pytest.mark.timeout(0)  # compiles messages in every language that ROS 2 has: as long as the machine needs
def test_the_general_packages_of_ros_2_are_built_by_plain_colcon(tmp_path: Path) -> None:
    workspace = copy(tmp_path, INTERFACES, LIBRARY, ALULA_ROOT / "ros2_ws/src/skillset_ros2")
    ros = {"PATH": f"{VENV2}/bin:/usr/bin:/bin", "ROS_VERSION": "2", "ROS_DISTRO": "jazzy"}
    prefix = {"AMENT_PREFIX_PATH": str(VENV2), "CMAKE_PREFIX_PATH": str(VENV2)}
    (tmp_path / "one_file.cmake").write_text(ONE_FILE_A_LIBRARY, encoding="utf-8")
    compiled_quickly = ("--cmake-args", f"-DCMAKE_PROJECT_INCLUDE={tmp_path / 'one_file.cmake'}", "-DCMAKE_RULE_MESSAGES=OFF")
    build(workspace, {**ros, **prefix}, "colcon", "build", "--merge-install", *compiled_quickly)
    site = workspace / f"install/lib/python{sys.version_info.major}.{sys.version_info.minor}/site-packages"
    names = ("alula.runtime.middleware", "skillset_ros2", "skillset_interfaces.srv")
    files = imported_from(site, str(VENV2 / "bin/python"), *names)
    assert all(file.is_relative_to(workspace / "install") for file in files), files


@pytest.mark.timeout(0)
def test_the_general_packages_of_ros_1_are_built_by_plain_catkin_make(tmp_path: Path) -> None:
    general = [ALULA_ROOT / "ros1_ws/src" / name for name in ("skillset_ros1", "resource_reporter", "alula_base")]
    workspace = copy(tmp_path, INTERFACES, LIBRARY, *general)
    build(workspace, {"CMAKE_PREFIX_PATH": "/usr", "ROS_VERSION": "1"}, "catkin_make", "-DPYTHON_EXECUTABLE=/usr/bin/python3")
    site = workspace / "devel/lib/python3/dist-packages"
    files = imported_from(site, "/usr/bin/python3", "alula.common.robots", "resource_reporter", "alula_base", "skillset_interfaces.srv")
    assert all(file.is_relative_to(workspace) for file in files), files


def imports(folder: Path) -> set[str]:
    """Return what the modules of a folder import, at the top or late, but for Python's own and templates."""
    found = set()
    for path in folder.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                found |= {alias.name.partition(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.level == 0:
                found.add((node.module or "").partition(".")[0])
    return found - sys.stdlib_module_names - STUBS - {folder.name}


def depends(manifest: Path) -> set[str]:
    """Return what a package needs to run, by its manifest."""
    root = ET.parse(manifest).getroot()  # noqa: S314 - our own
    return {str(element.text) for element in root if element.tag in {"depend", "exec_depend"}}


def manifests() -> dict[str, Path]:
    """Return the manifests of the checkout, its example robots included, by the package's name."""
    listed = subprocess.run(["git", "ls-files", "*package.xml"], cwd=ALULA_ROOT, capture_output=True, text=True, check=True).stdout
    found = [ALULA_ROOT / line for line in listed.split()]
    return {str(ET.parse(path).getroot().findtext("name")): path for path in found}  # noqa: S314 - our own


PACKAGES = manifests()


def modules_of(package: str) -> Path | None:
    """Return the folder of a package's modules; None where it has none."""
    folder = PACKAGES[package].parent
    return next((place for place in (folder / "src" / package, folder / package) if (place / "__init__.py").is_file()), None)


def launched_by(package: str) -> set[str]:
    """Return the packages that its launch files name."""
    texts = [path.read_text(encoding="utf-8") for path in (PACKAGES[package].parent / "launch").glob("*.launch")]
    return {name for text in texts for names in LAUNCHED.findall(text) for name in names if name} - {package}


def called(module: str) -> str:
    """Return a module's package as manifests name it: of ROS and of ours as it is, else as rosdep calls it."""
    if ROS.fullmatch(module) or module in PACKAGES:
        return module
    return f"python3-{DEBIAN.get(module, module).replace('_', '-')}" + ("-pip" if module in PIP else "")


def dependencies(*, extra: bool) -> set[str]:
    project = tomllib.loads((LIBRARY / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    optional = [name for names in project["optional-dependencies"].values() for name in names if not name.startswith("alula")]
    return {re.split("[<>=]", name)[0] for name in (optional if extra else project["dependencies"])}


PYTHON = [name for name in PACKAGES if name == "alula" or modules_of(name) is not None or launched_by(name)]


@pytest.mark.parametrize("package", PYTHON)
def test_a_manifest_names_what_the_package_needs_and_no_more(package: str) -> None:
    modules = modules_of(package)
    # What only some of the library's commands import is an extra of pip, which no manifest of ROS knows.
    extras = dependencies(extra=True) if package == "alula" else set()
    imported = set() if modules is None else imports(modules)
    needed = {called(module) for module in imported if OF_PYPI.get(module, module) not in extras} | launched_by(package)
    assert depends(PACKAGES[package]) == needed


def test_the_librarys_distribution_names_what_it_imports_and_no_more() -> None:
    imported = {OF_PYPI.get(module, module) for module in imports(LIBRARY / "alula")}
    assert imported == dependencies(extra=False) | dependencies(extra=True)
