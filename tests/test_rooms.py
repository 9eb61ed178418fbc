"""Every arrow points down, and no room below the robot knows one: strings count, because a command line is an arrow, too."""

from __future__ import annotations

import ast
import contextlib
import re
from collections.abc import Iterator
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

ALULA_ROOT = Path(__file__).resolve().parents[1]
ON_TOP = sorted(path.name for path in (ALULA_ROOT / "flight").iterdir() if (path / "__init__.py").is_file())
BELOW = ("bridge", "lib", "ros1_ws/src", "ros2_ws/src", "skillsets")
ROS = r"rclpy|rospy|roslib|roslaunch|rosbag|genpy|actionlib|rcl_interfaces|\w+_msgs|skillset_interfaces"
ADAPTERS = "skillset_ros1|skillset_ros2|resource_reporter|alula_base|node_core|skill_panel|ros_bridge"
DRONE_PACKAGES = "ground_station|lidar_mapping|lidar_obstacles|perception_core|radio_link|video_stream|zed_depth"
DRONE = rf"uav_\w+|{DRONE_PACKAGES}|navigation_\w+|perception_managers|mapping_managers|video_managers"
DRONE_WORDS = r"ardupilot|autopilots?|drones?|guidance|imu|lidar|lift[-_ ]?off|mavlink|radio\w*|take[-_ ]?off|telepilot|vehicles?|video|zed"
CONTRACT = {"lift_off", "landed"}
"""What files of a run have been called since there is but the drone (`summary.json`)."""
PAGE = ("lib/alula/report/page/program", "lib/alula/editor")
"""Programs of pages: every word counts, as no reader can tell which of them are shown."""
GENERATED = {"lib/alula/generate"}
"""Texts of the library that become code of a robot, which imports ROS."""
TYPES = "lib/alula/model/ros_types.py"
"""What types of models are called in ROS: names as data."""
RULES = {
    # The library: neither ROS nor a robot.
    "lib/alula": rf"{ROS}|{ADAPTERS}|{DRONE}|{DRONE_WORDS}",
    # The adapters and the bridge: no robot.
    "ros1_ws/src/skillset_ros1": rf"{DRONE}|{DRONE_WORDS}",
    "ros1_ws/src/resource_reporter": rf"{DRONE}|{DRONE_WORDS}|alula",
    "ros1_ws/src/alula_base": rf"{DRONE}|{DRONE_WORDS}|alula",
    "ros1_ws/src/node_core": rf"{DRONE}|{DRONE_WORDS}",
    "ros2_ws/src/skillset_ros2": rf"{DRONE}|{DRONE_WORDS}",
    "ros2_ws/src/skill_panel": rf"{DRONE}|{DRONE_WORDS}",
    "bridge/ros_bridge": rf"{DRONE}|{DRONE_WORDS}",
    # A run of any robot: no robot either, not even by what it consists of.
    "flight": rf"{DRONE}|{DRONE_WORDS}",
}

LIBRARY = ALULA_ROOT / "lib/alula"
ROOMS = {
    # The core path.
    "common": "",
    "model": "common",
    "language": "common model",
    "generate": "language model",
    "runtime": "common model",
    "mock": "common language model runtime",
    "trees": "common",
    "missions": "common mock model runtime trees",
    "check": "common language missions model trees",
    "records": "common language missions mock model runtime",
    "report": "common model records runtime",
    # What stands on it.
    "prove": "common language missions model runtime trees",
    "odds": "check common missions mock model prove records",
    "repair": "check common language missions model odds prove records trees",
    "campaign": "common missions mock model prove records runtime trees",
    "console": "common model records report runtime",
    "editor": "check common language missions model prove trees",
    "adopt": "check generate language missions model trees",
    # What the public API adds, and on top of it the programs; nobody imports these.
    "api": "campaign check common language missions mock model odds prove records report runtime trees",
    "cli": "adopt api campaign check common console editor generate language missions mock model odds prove records repair report runtime "
    "trees",
}
"""The rooms of the library from below, each with those that it may import."""
PARTS = "alula.parts"
"""The face for what a robot adds, beside ``alula``."""


def texts() -> Iterator[tuple[Path, str]]:
    """Yield each text below, but for tests."""
    for room in BELOW:
        for path in sorted((ALULA_ROOT / room).rglob("*")):
            parts = path.relative_to(ALULA_ROOT).parts
            if path.is_file() and not {"test", "__pycache__"} & set(parts):
                with contextlib.suppress(UnicodeDecodeError):
                    yield path, path.read_text(encoding="utf-8")


def test_no_room_below_names_a_package_on_top() -> None:
    assert "alula_flight" in ON_TOP
    named = re.compile(rf"\b({'|'.join(ON_TOP)})\b")
    found = [f"{path}:{text.count(chr(10), 0, match.start()) + 1}: {match[0]}" for path, text in texts() for match in named.finditer(text)]
    assert not found, "\n".join(found)


def docstrings(tree: ast.AST) -> set[int]:
    """Return the ids of the strings of a module that stand alone: what they say is for readers."""
    return {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)}


def names_in(text: str) -> Iterator[tuple[int, str]]:
    """Yield the modules that a module imports, and its strings, with their lines."""
    tree = ast.parse(text)
    spoken = docstrings(tree)
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield node.lineno, node.module or ""
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in spoken:
            yield node.lineno, node.value


def modules(*rooms: str) -> Iterator[Path]:
    """Yield the Python modules of rooms, but for tests."""
    for room in rooms:
        for path in sorted((ALULA_ROOT / room).rglob("*.py")):
            if "test" not in path.relative_to(ALULA_ROOT / room).parts:
                yield path


@pytest.mark.parametrize("room", RULES)
def test_no_room_knows_what_stands_on_it(room: str) -> None:
    # With a slash behind, it is the name of a type, as the language and logs have it.
    forbidden = re.compile(rf"(?i)(?<![\w.])({RULES[room]})\b(?!/)")
    found = [
        f"{path}:{line}: {match[0]}"
        for path in modules(room)
        if not {str(one.relative_to(ALULA_ROOT)) for one in (path, path.parent)} & {*GENERATED, TYPES}
        for line, name in names_in(path.read_text(encoding="utf-8"))
        for match in forbidden.finditer(name)
        if match[1] not in CONTRACT
    ]
    assert not found, "\n".join(found)


def test_no_page_knows_the_drone() -> None:
    forbidden = re.compile(rf"(?i)(?<![a-z])({DRONE_WORDS}|land(?:ed|ing)?|fl(?:y|ies|ew|own|ight)s?)(?![a-z])")
    found = [
        f"{path}:{number}: {match[0]}"
        for room in PAGE
        for path in sorted((ALULA_ROOT / room).rglob("*"))
        if path.suffix in {".js", ".html", ".css"}
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        for match in forbidden.finditer(line)
        if match[1] not in CONTRACT
    ]
    assert not found, "\n".join(found)


def rooms_named(path: Path) -> Iterator[str]:
    """Yield the modules of the library that one of its modules names; ``alula`` or ``alula.parts`` where it imports a face."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module == "alula":
            yield from (f"alula.{alias.name}" if alias.name in ROOMS else "alula" for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module == PARTS:
            yield PARTS
    if str(path.parent.relative_to(ALULA_ROOT)) in GENERATED:  # its strings name what a robot's code imports
        yield from (name for _, name in names_in(path.read_text(encoding="utf-8")) if re.fullmatch(r"alula(\.\w+)+", name))
    else:
        for _, name in names_in(path.read_text(encoding="utf-8")):
            yield from (found[0] for found in re.finditer(r"(?<![\w./])alula\.(\w+)(\.\w+)*", name) if found[1] in ROOMS)


def room_of(name: str) -> str:
    """Return the room of a module of the library; empty: the library's face."""
    return name.partition(".")[2].partition(".")[0]


def test_every_arrow_between_rooms_of_the_library_is_in_the_table() -> None:
    found = set()
    for path in modules("lib/alula"):
        name = ".".join(path.relative_to(LIBRARY.parent).with_suffix("").parts).removesuffix(".__init__")
        if not (room := room_of(name)) or name == PARTS:
            continue  # the library's faces look into all rooms
        assert room in ROOMS, f"{path}: the room {room} has no row in ROOMS"
        allowed = {room, *ROOMS[room].split()}
        found |= {f"{name} -> {other}" for other in rooms_named(path) if room_of(other) not in allowed}
    assert not found, "not in ROOMS:\n" + "\n".join(sorted(found))


def test_the_table_of_rooms_points_down() -> None:
    """Each room may import only such as stand before it: so there is no circle among rooms."""
    names = list(ROOMS)
    assert not {(name, other) for at, name in enumerate(names) for other in ROOMS[name].split() if other not in names[:at]}


def imports_of_modules() -> dict[str, set[str]]:
    """Return what each module of the library imports of it, anywhere in its text: for annotations, and in functions, too."""
    paths = {
        ".".join(path.relative_to(LIBRARY.parent).with_suffix("").parts).removesuffix(".__init__"): path for path in modules("lib/alula")
    }
    found: dict[str, set[str]] = {}
    for name, path in paths.items():
        nodes = list(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))
        plain = {alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names}
        froms = [(node.module, alias.name) for node in nodes if isinstance(node, ast.ImportFrom) and node.module for alias in node.names]
        named = plain | {f"{module}.{one}" if f"{module}.{one}" in paths else module for module, one in froms}
        found[name] = named & set(paths)
    return found


def test_no_circle_among_the_modules_of_the_library() -> None:
    """An import in a function, or for annotations only, hides none: so what stands below can be read without what stands on it."""
    imports = imports_of_modules()
    assert {"alula.trees.node_type", "alula.trees.attributes"} <= imports["alula.trees.node"]
    TopologicalSorter(imports).prepare()  # raises CycleError with the circle


def test_the_engine_needs_no_parser() -> None:
    """What executes a model gets it as values: model and runtime import nothing of the language."""
    rooms = [f"lib/alula/{room}" for room in ("common", "model", "runtime/core", "runtime/managers", "runtime/client", "runtime/local")]
    found = [
        f"{path}: {name}"
        for path in modules(*rooms)
        for _, name in names_in(path.read_text(encoding="utf-8"))
        if name.startswith(("alula.language", "alula.prove", "alula.editor"))
    ]
    assert not found, "\n".join(found)


def test_the_bridge_uses_only_what_both_worlds_share() -> None:
    found = [
        f"{path}: {name}"
        for path in modules("bridge/ros_bridge/ros_bridge")
        for _, name in names_in(path.read_text(encoding="utf-8"))
        if name.startswith("alula.") and not name.startswith("alula.common")
    ]
    assert not found, "\n".join(found)


PUBLIC = {"alula", "alula.trees", "alula.parts", "skillset_ros2", "skillset_ros1"}
"""What a robot's own code may import of Alula, by name and not below."""
ROBOTS = ("examples", "lib/alula/generate/scaffold/robot", "ros2_ws/src/uav_missions", "ros2_ws/src/uav_skills")
HELPERS = "alula_testing"
"""Of the checkout's tests."""
INSIDE = {
    "uav_missions_fakes.py": "clients that a test ends",
    "test_uav_missions_director.py": "the director around the drone's tree",
    "test_uav_missions_live.py": "the record while it is written",
    "test_uav_skills_decisions.py": "a robot's folder without its parts",
}
"""Tests of the drone that look below the API, each at what."""
PRIVATE_IMPORT = re.compile(r"^\s*(?:from|import) +(alula[\w.]*|skillset_ros[12][\w.]*)(?: +import +(.*))?", re.MULTILINE)


def robots_texts() -> Iterator[Path]:
    """Yield the files of robots that are or become Python, tests too."""
    for room in ROBOTS:
        for path in sorted((ALULA_ROOT / room).rglob("*")):
            # Scripts of ROS packages have no suffix.
            if path.is_file() and path.suffix in {".py", ".in", ""} and not {"__pycache__", ".alula", "runs"} & set(path.parts):
                yield path


def imported_by(text: str) -> Iterator[tuple[int, str]]:
    """Yield the modules of Alula that a text imports, with their lines; one that is imported `from alula` counts as its own name."""
    for match in PRIVATE_IMPORT.finditer(text):
        line = text.count("\n", 0, match.start(1)) + 1
        module, names = match[1], re.findall(r"\w+", (match[2] or "").partition(" as ")[0])
        yield line, module
        if module == "alula":
            yield from ((line, f"alula.{name}") for name in names if (ALULA_ROOT / "lib/alula" / name).is_dir())


def private_imports(path: Path) -> list[str]:
    """Return what a file imports that is not public."""
    text = path.read_text(encoding="utf-8", errors="ignore")
    return [f"{path}:{line}: {name}" for line, name in imported_by(text) if name not in PUBLIC and name.partition(".")[0] != HELPERS]


def test_a_robots_own_code_imports_only_what_is_public() -> None:
    paths = [path for path in robots_texts() if path.name not in INSIDE]
    assert len([path for path in paths if PRIVATE_IMPORT.search(path.read_text(encoding="utf-8", errors="ignore"))]) > 20
    assert [line for path in paths for line in private_imports(path)] == []


def test_what_looks_below_the_api_is_needed_and_starts_no_command_line() -> None:
    looked = {path.name: private_imports(path) for path in robots_texts() if path.name in INSIDE}
    assert {name for name, found in looked.items() if found} == set(INSIDE), "one that needs nothing private any more can go"
    assert not [line for found in looked.values() for line in found if re.search(r"alula\.(cli|api)", line)]


@pytest.mark.parametrize(
    ("line", "private"),
    [
        ("from alula import Mission, parts", []),
        ("from alula.trees import register", []),
        ("    from alula.parts import RunPart", []),
        ("from skillset_ros2 import Robot", []),
        ("from alula.trees.node import Action", ["alula.trees.node"]),
        ("from alula import missions", ["alula.missions"]),
        ("import alula.runtime.local as local", ["alula.runtime.local"]),
        ("from skillset_ros2.base import QUIET", ["skillset_ros2.base"]),
    ],
)
def test_what_is_private_is_seen(line: str, private: list[str]) -> None:
    assert [name for _, name in imported_by(line) if name not in PUBLIC] == private


def test_the_pages_for_users_import_only_what_is_public() -> None:
    names = ("start/own-robot", "how-to/client", "reference/mocks")
    pages = [ALULA_ROOT / "README.md", *(ALULA_ROOT / "docs" / f"{name}.md" for name in names)]
    found = [
        f"{page}:{line}: {name}" for page in pages for line, name in imported_by(page.read_text(encoding="utf-8")) if name not in PUBLIC
    ]
    assert found == []
