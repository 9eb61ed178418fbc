"""Build a ROS 1 workspace with catkin_make: the packages that have changed since they were last built, and those that need them.

usage: python build_ros1.py alula|robot, in the ROS 1 world's environment. What was built from what is kept in ``built.json`` of the
workspace. catkin configures a workspace as a whole, and asks each message of it whether it is as it was; so what has not changed is
left out, and found in the devel space by what needs it. A change of Python or generators builds everything again.

catkin would start Python twice for each message. It tells here what messages there are, and genpy writes all modules in this process.
"""

from __future__ import annotations

import os
import runpy
import shutil
import subprocess
import sys
from collections import defaultdict
from collections.abc import Collection, Iterable, Iterator
from pathlib import Path

from workspace import WORKSPACES, Built, Workspace, digest, prefixes_below

TOOLS = ("catkin", "genmsg", "genpy", "genaction", "actionlib_msgs")
# The interpreter of the environment goes into the shebangs of the nodes' relay scripts; newer catkin looks for it under the second name.
PYTHON = Path(sys.prefix) / "bin" / "python3"
CMAKE_ARGUMENTS = (
    f"-DPYTHON_EXECUTABLE={PYTHON}",
    f"-DPython_EXECUTABLE={PYTHON}",
    "-DCATKIN_ENABLE_TESTING=OFF",
    "-DCMAKE_RULE_MESSAGES=OFF",
)
# Everything in the ROS 1 world is Python, and that is generated below.
LEFT_OUT = "gencpp:geneus:genlisp:gennodejs:genpy"


def toolchain() -> str:
    """Return what decides how everything is built."""
    manifests = (place / "share" / name / "package.xml" for name in TOOLS for place in (*prefixes_below(), Path("/usr")))
    return digest(sys.version, *CMAKE_ARGUMENTS, LEFT_OUT, *(path.read_bytes() for path in manifests if path.exists()))


def link_sources(workspace: Workspace) -> None:
    """Have the source space hold links to the packages: catkin_make writes its toplevel file beside them."""
    sources = workspace.folder / "src"
    shutil.rmtree(sources, ignore_errors=True)
    sources.mkdir(parents=True)
    for name, package in workspace.packages.items():
        (sources / name).symlink_to(package.folder.resolve())


def run_catkin(workspace: Workspace, only: Collection[str]) -> int:
    """Build some packages of a workspace whose others are in the devel space, or all when none are named; return catkin's exit code."""
    folder = workspace.folder
    command = ["catkin_make", "-C", str(folder), "--source", str(folder / "src"), "--force-cmake", f"-j{os.cpu_count()}"]
    command += [*CMAKE_ARGUMENTS, f"-DCATKIN_WHITELIST_PACKAGES={';'.join(only)}"]
    prefixes = [folder / "devel"] if only else []
    path = os.pathsep.join(map(str, [*prefixes, *workspace.prefixes]))
    return subprocess.run(command, env={**os.environ, "CMAKE_PREFIX_PATH": path, "ROS_LANG_DISABLE": LEFT_OUT}, check=False).returncode


def contexts(workspace: Workspace, names: Iterable[str]) -> Iterator[tuple[str, dict[str, str]]]:
    """Yield the packages that have messages or services, each with what catkin has noted for its generators."""
    for name in names:
        noted = workspace.folder / "build" / name / "cmake" / f"{name}-genmsg-context.py"
        if noted.exists():
            yield name, runpy.run_path(str(noted))


def generate_messages(workspace: Workspace, names: Iterable[str]) -> int:
    """Write the Python modules of all messages and services of these packages into the devel space; return 1 where one is wrong."""
    sys.path += [place for place in os.environ.get("ALULA_UNDERLAY_PYTHON", "").split(os.pathsep) if place]
    from genpy.generate_initpy import write_modules
    from genpy.generator import MsgGenerator, SrvGenerator

    code = 0
    for name, noted in contexts(workspace, names):
        package = workspace.folder / "devel" / "lib" / "python3" / "dist-packages" / name
        package.mkdir(parents=True, exist_ok=True)
        if not (package / "__init__.py").exists():
            (package / "__init__.py").touch()
        places: defaultdict[str, list[str]] = defaultdict(list)
        included = noted["dep_include_paths_str"].split(";")
        for needed, place in zip(included[::2], included[1::2], strict=True):
            places[needed].append(place)
        for folder, generator, files in (
            (package / "msg", MsgGenerator(), noted["messages_str"]),
            (package / "srv", SrvGenerator(), noted["services_str"]),
        ):
            shutil.rmtree(folder, ignore_errors=True)
            if files:
                code = max(code, generator.generate_messages(name, files.split(";"), str(folder), dict(places)))
                write_modules(str(folder))
    return code


def build(workspace: Workspace) -> int:
    """Build what has changed; return the exit code."""
    states, tools, record = workspace.states(), toolchain(), workspace.folder / "built.json"
    built = Built.read(record)
    if built is not None and (built.tools != tools or built.gone(states)):
        workspace.clear()
        built = None
    if built is None or not (workspace.folder / "devel" / "setup.sh").exists():
        built = Built(tools, {})
    changed = built.changed(states)
    sys.stdout.write(f"to build: {' '.join(changed) or 'nothing'}\n")
    sys.stdout.flush()
    link_sources(workspace)
    built.without(changed).write(record)
    code = run_catkin(workspace, changed if built.packages else ()) if changed else 0
    code = code or generate_messages(workspace, changed)
    if code == 0:
        Built(tools, states).write(record)
    return code


if __name__ == "__main__":
    sys.exit(build(WORKSPACES[sys.argv[1]]("1")))
