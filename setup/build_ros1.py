"""Build the ROS 1 workspace with catkin_make: the packages that have changed since they were last built, and those that need them.

Runs in the ROS 1 world's environment. What was built from what is kept in ``$ALULA_STATE/ros1/built.json``. catkin configures a
workspace as a whole, and asks each message of it whether it is as it was; so what has not changed is left out, and found in the devel
space by what needs it. A change of Python or generators builds everything again.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Collection, Mapping
from pathlib import Path

from workspace import Built, Package, digest, find_packages, state_of

ROOT = Path(os.environ["ALULA_ROOT"])
STATE = Path(os.environ["ALULA_STATE"])
WORKSPACE = STATE / "ros1"
SOURCES, BUILD, DEVEL, BUILT = (WORKSPACE / name for name in ("src", "build", "devel", "built.json"))
TOOLS = ("catkin", "genmsg", "genpy", "genaction", "actionlib_msgs")
# The interpreter of the environment goes into the shebangs of the nodes' relay scripts; newer catkin looks for it under the second name.
PYTHON = Path(sys.prefix) / "bin" / "python3"
CMAKE_ARGUMENTS = (f"-DPYTHON_EXECUTABLE={PYTHON}", f"-DPython_EXECUTABLE={PYTHON}", "-DCATKIN_ENABLE_TESTING=OFF")
# Everything in the ROS 1 world is Python.
LEFT_OUT = "gencpp:geneus:genlisp:gennodejs"


def toolchain() -> str:
    """Return what decides how everything is built."""
    manifests = (Path("/usr/share") / name / "package.xml" for name in TOOLS)
    return digest(sys.version, *CMAKE_ARGUMENTS, LEFT_OUT, *(path.read_bytes() for path in manifests if path.exists()))


def link_sources(packages: Mapping[str, Package]) -> None:
    """Have the source space hold links to the packages: catkin_make writes its toplevel file beside them."""
    shutil.rmtree(SOURCES, ignore_errors=True)
    SOURCES.mkdir(parents=True)
    for package in packages.values():
        (SOURCES / package.folder.name).symlink_to(package.folder.resolve())


def run_catkin(only: Collection[str]) -> int:
    """Build some packages of a workspace whose others are in the devel space, or all when none are named; return catkin's exit code."""
    command = ["catkin_make", "-C", str(WORKSPACE), "--source", str(SOURCES), "--force-cmake", f"-j{os.cpu_count()}"]
    command += [*CMAKE_ARGUMENTS, f"-DCATKIN_WHITELIST_PACKAGES={';'.join(only)}"]
    prefix = f"{DEVEL}:/usr" if only else "/usr"
    return subprocess.run(command, env={**os.environ, "CMAKE_PREFIX_PATH": prefix, "ROS_LANG_DISABLE": LEFT_OUT}, check=False).returncode


def build() -> int:
    """Build what has changed; return the exit code."""
    packages = find_packages([ROOT / "ros1_ws/src"]) | find_packages([STATE / "generated"], "*_interfaces")
    states = {name: state_of(name, packages) for name in packages}
    tools, built = toolchain(), Built.read(BUILT)
    if built is not None and built.tools != tools:
        for folder in (BUILD, DEVEL):
            shutil.rmtree(folder, ignore_errors=True)
    if built is None or not (DEVEL / "setup.sh").exists():
        built = Built(tools, {})
    changed = built.changed(states)
    sys.stdout.write(f"to build: {' '.join(changed) or 'nothing'}\n")
    sys.stdout.flush()
    link_sources(packages)
    code = run_catkin(changed if built.packages else ()) if changed else 0
    if code == 0:
        Built(tools, states).write(BUILT)
    return code


if __name__ == "__main__":
    sys.exit(build())
