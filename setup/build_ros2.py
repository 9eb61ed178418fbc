"""Build the ROS 2 workspace with colcon: the packages that have changed since they were last built, and those that need them.

Runs in the ROS 2 world's environment. What was built from what is kept in ``$ALULA_STATE/ros2/built.json``. A change of compiler,
Python or generators builds everything again.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Mapping
from importlib.metadata import distributions
from pathlib import Path

from workspace import Built, Package, build_files, digest, find_packages, state_of

ROOT = Path(os.environ["ALULA_ROOT"])
STATE = Path(os.environ["ALULA_STATE"])
PLACES = ("ros2_ws/src", "bridge")
BUILT = STATE / "ros2" / "built.json"
BUILD, INSTALL, LOG = (STATE / "ros2" / name for name in ("build", "install", "log"))
TOOLS = re.compile(r"(ros-|colcon-|empy|catkin-pkg|numpy)", re.IGNORECASE)
CMAKE_ARGUMENTS = (
    "-DCMAKE_BUILD_TYPE=None",
    # The bridge's data plane sets flags of its own; everything else in C++ is type support, compiled quickly rather than well.
    "-DCMAKE_CXX_FLAGS=-O0",
    "-DCMAKE_C_FLAGS=-O1",
    f"-DPython3_EXECUTABLE={sys.executable}",
    f"-DPYTHON_EXECUTABLE={sys.executable}",
    "-DBUILD_TESTING=OFF",
    f"-DCMAKE_PROJECT_INCLUDE={ROOT / 'setup' / 'interfaces.cmake'}",
)


def toolchain() -> str:
    """Return what decides how everything is built."""
    installed = distributions(path=[sysconfig.get_path("purelib")])
    tools = sorted(f"{d.metadata['Name']}=={d.version}" for d in installed if TOOLS.match(d.metadata["Name"]))
    compiler = subprocess.run(["c++", "--version"], capture_output=True, text=True, check=True).stdout
    sources = [(ROOT / "setup" / name).read_bytes() for name in ("interfaces.cmake", "repair_wheels.py")]
    return digest(sys.version, compiler, *CMAKE_ARGUMENTS, *tools, *sources)


def read_built(packages: Mapping[str, Package], states: Mapping[str, str], tools: str) -> Built:
    """Return what was built; nothing when the toolchain was another, and then nothing of it is kept."""
    built = Built.read(BUILT)
    if built is None:  # an interrupted build, or one by colcon itself: what is younger than its sources counts
        return Built(tools, {name: states[name] for name, package in packages.items() if is_younger(name, package)})
    if built.tools != tools:
        for folder in (BUILD, INSTALL):
            shutil.rmtree(folder, ignore_errors=True)
        BUILT.unlink()
        return Built(tools, {})
    return built


def run_colcon(names: list[str], packages: Mapping[str, Package]) -> int:
    """Build some packages; return colcon's exit code."""
    paths = [str(packages[name].folder) for name in packages]
    command = ["colcon", "--log-base", str(LOG), "build", "--merge-install", "--symlink-install", "--paths", *paths]
    command += ["--build-base", str(BUILD), "--install-base", str(INSTALL), "--packages-select", *names]
    command += ["--event-handlers", "console_cohesion+", "--cmake-args", *CMAKE_ARGUMENTS]
    return subprocess.run(command, cwd=STATE / "ros2", check=False).returncode


def succeeded(name: str) -> bool:
    """Tell whether colcon's last build of a package went well."""
    code = BUILD / name / "colcon_build.rc"
    return code.exists() and code.read_text(encoding="ascii").strip() == "0"


def is_younger(name: str, package: Package) -> bool:
    """Tell whether a package was built after its files were last written."""
    if not succeeded(name):
        return False
    built_s = (BUILD / name / "colcon_build.rc").stat().st_mtime
    return all(path.stat().st_mtime < built_s for path in build_files(package.folder))


def has_leftovers(name: str, package: Package) -> bool:
    """Tell whether code generated of a definition that is gone is left: rosidl does not make its lists of messages again then."""
    generated = (BUILD / name / "rosidl_generator_py" / name).glob("*/_*.py")
    kept = {path.stem.replace("_", "").lower() for path in generated if path.name != "__init__.py"}
    defined = {path.stem.replace("_", "").lower() for path in build_files(package.folder) if path.suffix in {".msg", ".srv", ".action"}}
    return not kept <= defined


def is_incomplete(name: str, package: Package) -> bool:
    """Tell whether an interface package was configured without a type support that the middleware needs."""
    targets = BUILD / name / "CMakeFiles" / "TargetDirectories.txt"
    has_messages = any(path.suffix in {".msg", ".srv", ".action"} for path in build_files(package.folder))
    return has_messages and targets.exists() and "__rosidl_typesupport_introspection_c.dir" not in targets.read_text(encoding="utf-8")


def build() -> int:
    """Build what has changed; return the exit code."""
    packages = find_packages([*(ROOT / place for place in PLACES), STATE / "generated"])
    states = {name: state_of(name, packages) for name in packages}
    tools = toolchain()
    built = read_built(packages, states, tools)
    leftovers = [name for name, package in packages.items() if has_leftovers(name, package)]
    for name in leftovers:
        shutil.rmtree(BUILD / name)
    incomplete = [name for name, package in packages.items() if is_incomplete(name, package)]
    again = {*built.changed(states), *leftovers, *incomplete}
    changed = [name for name in packages if name in again]
    sys.stdout.write(f"to build: {' '.join(changed) or 'nothing'}\n")
    sys.stdout.flush()
    for name in changed:
        (BUILD / name / "colcon_build.rc").unlink(missing_ok=True)
    code = run_colcon(changed, packages) if changed else 0
    Built(tools, {name: state for name, state in states.items() if name not in changed or succeeded(name)}).write(BUILT)
    return code


if __name__ == "__main__":
    sys.exit(build())
