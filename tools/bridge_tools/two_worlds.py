"""Import rospy and rclpy side by side, in one interpreter: the soak is a peer of the bridge in both worlds.

Both worlds have packages of the same names (``std_msgs`` ...). rospy needs ROS 1's while it is imported, and keeps them itself
afterwards; so they are taken out of ``sys.modules`` again, and from then on every import is ROS 2's.
"""

from __future__ import annotations

import importlib
import importlib.util
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType

from ros_bridge.errors import WorldError

PLACES_VARIABLE = "ROS_BRIDGE_ROS1_PATH"
ASK = "import importlib.util as u, os; s = u.find_spec('rospy'); print(os.path.dirname(os.path.dirname(s.origin)) if s else '')"
ASK_TIMEOUT_S = 20.0
# Compiled packages load once in a process: this environment's copies have to be there before ROS 1's folder is in front.
KEEP_OURS = ("numpy", "yaml")


def find_ros1_path() -> Path:
    """Find the folder that rospy is imported from: told by the environment, else asked of Pythons of this version, else /opt/ros.

    Raises:
        WorldError: There is none.
    """
    for candidate in _candidates():
        if (candidate / "rospy" / "__init__.py").is_file():
            return candidate
    version = f"{sys.version_info.major}.{sys.version_info.minor}"
    raise WorldError(
        f"no rospy for Python {version}: install it (Debian: apt install python3-rospy), "
        f"or set {PLACES_VARIABLE} to the folder that holds rospy/",
    )


def _candidates() -> Iterator[Path]:
    if told := os.environ.get(PLACES_VARIABLE):
        yield Path(told)
    yield from (Path(entry) for entry in sys.path if entry)
    version = f"{sys.version_info.major}.{sys.version_info.minor}"
    for python in (f"/usr/bin/python{version}", f"/usr/local/bin/python{version}"):
        if Path(python).is_file():
            yield from _ask(python)
    yield from sorted(Path("/opt/ros").glob("*/lib/python3/dist-packages"))


def _ask(python: str) -> Iterator[Path]:
    """Ask another interpreter where its rospy is, without importing it there and without this environment's variables."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    answer = subprocess.run([python, "-c", ASK], env=environment, capture_output=True, text=True, timeout=ASK_TIMEOUT_S, check=False)
    if answer.returncode == 0 and answer.stdout.strip():
        yield Path(answer.stdout.strip())


@contextmanager
def _in_front(folder: Path) -> Iterator[None]:
    """Put a folder in front of the import path for a while, with no compiled leftovers of it in the path cache."""
    sys.path.insert(0, str(folder))
    importlib.invalidate_caches()
    try:
        yield
    finally:
        sys.path.remove(str(folder))
        importlib.invalidate_caches()


def _is_message_package(name: str, folder: Path) -> bool:
    return any((folder / name / kind / "__init__.py").is_file() for kind in ("msg", "srv"))


def import_ros1(*message_modules: str) -> dict[str, ModuleType]:
    """Import rospy and give its message packages' names back to ROS 2; return ROS 1's modules of the given names (``std_msgs.msg``).

    ROS 2 message packages that are imported already are put back afterwards. Call it once, before other threads import anything.

    Raises:
        WorldError: rospy is not there.
    """
    folder = find_ros1_path()
    for name in KEEP_OURS:
        importlib.import_module(name)
    ros2_messages = _take_out_messages(folder)
    try:
        with _in_front(folder):
            importlib.import_module("rospy")
            return {name: importlib.import_module(name) for name in message_modules}
    finally:
        _take_out_messages(folder)
        sys.modules.update(ros2_messages)


def _take_out_messages(folder: Path) -> dict[str, ModuleType]:
    """Remove the modules of all message packages that ROS 1 has from the table of imported ones, and return them."""
    tops = {name.partition(".")[0] for name in sys.modules}
    messages = {name for name in tops if _is_message_package(name, folder)}
    names = [name for name in sys.modules if name.partition(".")[0] in messages]
    return {name: sys.modules.pop(name) for name in names}
