"""Build a ROS 2 workspace with colcon: the packages that have changed since they were last built, and those that need them.

usage: python build_ros2.py alula|robot, in the ROS 2 world's environment. What was built from what is kept in ``built.json`` of the
workspace. A change of compiler, Python or generators builds everything again.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from importlib.metadata import distributions
from pathlib import Path

from workspace import ROOT, WORKSPACES, Built, Package, Workspace, build_files, digest, prefixes_below

TOOLS = re.compile(r"(ros-|colcon-|empy|catkin-pkg|numpy)", re.IGNORECASE)
CMAKE_ARGUMENTS = (
    "-DCMAKE_BUILD_TYPE=None",
    # The bridge's data plane sets flags of its own; everything else is messages and their type support, compiled quickly rather than
    # well: Python takes as long to serialise a skill's goal as with -O1.
    "-DCMAKE_CXX_FLAGS=-O0",
    "-DCMAKE_C_FLAGS=-O0",
    "-DCMAKE_RULE_MESSAGES=OFF",  # each line of progress is a process
    f"-DPython3_EXECUTABLE={sys.executable}",
    f"-DPYTHON_EXECUTABLE={sys.executable}",
    "-DBUILD_TESTING=OFF",
    f"-DCMAKE_PROJECT_INCLUDE={ROOT / 'setup' / 'interfaces.cmake'}",
)
# By this interpreter, and not by the one that colcon was installed for: what it installs runs in the environment of the workspace.
COLCON = (sys.executable, "-c", "import sys; from colcon_core.command import main; sys.argv[0] = 'colcon'; sys.exit(main())")


def toolchain() -> str:
    """Return what decides how everything is built."""
    tools = sorted({f"{d.metadata['Name']}=={d.version}" for d in distributions() if TOOLS.match(d.metadata["Name"])})
    given = [path.read_bytes() for place in prefixes_below() for path in sorted(place.glob("share/rosidl_*/package.xml"))]
    compiler = subprocess.run(["c++", "--version"], capture_output=True, text=True, check=True).stdout
    sources = [(ROOT / "setup" / name).read_bytes() for name in ("interfaces.cmake", "repair_wheels.py")]
    return digest(sys.version, compiler, *CMAKE_ARGUMENTS, *tools, *given, *sources)


def read_built(workspace: Workspace, states: dict[str, str], tools: str) -> Built:
    """Return what was built; nothing when the toolchain was another or packages are gone, and then nothing of it is kept."""
    built = Built.read(workspace.folder / "built.json")
    if built is None:  # an interrupted build, or one by colcon itself: what is younger than its sources counts
        return Built(tools, {name: states[name] for name, package in workspace.packages.items() if is_younger(workspace, name, package)})
    # Of a package in Python that is gone nothing is found any more; what was compiled would be.
    compiled = [name for name in built.gone(states) if (workspace.folder / "build" / name / "CMakeCache.txt").exists()]
    if built.tools != tools or compiled:
        workspace.clear()
        return Built(tools, {})
    return built


def run_colcon(workspace: Workspace, names: list[str]) -> int:
    """Build some packages; return colcon's exit code."""
    folder = workspace.folder
    path = os.pathsep.join(map(str, workspace.prefixes))
    command = [*COLCON, "--log-base", str(folder / "log"), "build", "--merge-install", "--symlink-install", "--paths"]
    command += [str(package.folder) for package in workspace.packages.values()]
    command += ["--build-base", str(folder / "build"), "--install-base", str(folder / "install"), "--packages-select", *names]
    command += ["--event-handlers", "console_cohesion+", "--cmake-args", *CMAKE_ARGUMENTS]
    environment = {**os.environ, "AMENT_PREFIX_PATH": path, "CMAKE_PREFIX_PATH": path}
    return subprocess.run(command, cwd=folder, env=environment, check=False).returncode


def result_of(workspace: Workspace, name: str) -> Path:
    """Return the file that holds the exit code of colcon's last build of a package."""
    return workspace.folder / "build" / name / "colcon_build.rc"


def succeeded(workspace: Workspace, name: str) -> bool:
    """Tell whether colcon's last build of a package went well."""
    code = result_of(workspace, name)
    return code.exists() and code.read_text(encoding="ascii").strip() == "0"


def is_younger(workspace: Workspace, name: str, package: Package) -> bool:
    """Tell whether a package was built after its files were last written."""
    if not succeeded(workspace, name):
        return False
    built_s = result_of(workspace, name).stat().st_mtime
    return all(path.stat().st_mtime < built_s for path in build_files(package.folder))


def has_leftovers(workspace: Workspace, name: str, package: Package) -> bool:
    """Tell whether code generated of a definition that is gone is left: rosidl does not make its lists of messages again then."""
    generated = (workspace.folder / "build" / name / "rosidl_generator_py" / name).glob("*/_*.py")
    kept = {path.stem.replace("_", "").lower() for path in generated if path.name != "__init__.py"}
    defined = {path.stem.replace("_", "").lower() for path in build_files(package.folder) if path.suffix in {".msg", ".srv", ".action"}}
    return not kept <= defined


def is_incomplete(workspace: Workspace, name: str, package: Package) -> bool:
    """Tell whether an interface package was configured without a type support that the middleware needs."""
    targets = workspace.folder / "build" / name / "CMakeFiles" / "TargetDirectories.txt"
    has_messages = any(path.suffix in {".msg", ".srv", ".action"} for path in build_files(package.folder))
    return has_messages and targets.exists() and "__rosidl_typesupport_introspection_c.dir" not in targets.read_text(encoding="utf-8")


def build(workspace: Workspace) -> int:
    """Build what has changed; return the exit code."""
    packages, states, tools = workspace.packages, workspace.states(), toolchain()
    workspace.folder.mkdir(parents=True, exist_ok=True)
    built = read_built(workspace, states, tools)
    leftovers = [name for name, package in packages.items() if has_leftovers(workspace, name, package)]
    for name in leftovers:
        shutil.rmtree(workspace.folder / "build" / name)
    incomplete = [name for name, package in packages.items() if is_incomplete(workspace, name, package)]
    again = {*built.changed(states), *leftovers, *incomplete}
    changed = [name for name in packages if name in again]
    sys.stdout.write(f"to build: {' '.join(changed) or 'nothing'}\n")
    sys.stdout.flush()
    for name in changed:
        result_of(workspace, name).unlink(missing_ok=True)
    code = run_colcon(workspace, changed) if changed else 0
    kept = {name: state for name, state in states.items() if name not in changed or succeeded(workspace, name)}
    Built(tools, kept).write(workspace.folder / "built.json")
    return code


if __name__ == "__main__":
    sys.exit(build(WORKSPACES[sys.argv[1]]("2")))
