"""The robot that commands are about: what its ``robot.yaml`` says it consists of.

A robot is a folder of its own, anywhere. It is found from the current folder upwards, or named by ``--robot DIR``, which the entry
script passes on in ``ALULA_ROBOT``. The drone of this repository is one.
"""

from __future__ import annotations

import contextlib
import functools
import importlib
import os
import re
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextvars import ContextVar
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any

from alula.common.errors import AlulaError
from alula.common.keys import Key
from alula.common.located_yaml import Located, choices, read_yaml
from alula.common.public import public
from alula.common.robot_page import USUAL_PAGE, read_page

FILE = "robot.yaml"
VARIABLE = "ALULA_ROBOT"
BEHAVIOUR, FAULTS = "mock.yaml", "faults.yaml"
"""Files beside the models: what mocks do, and what faults bring about."""
PARTS: Mapping[str, str] = {
    "inputs": "a function that reads a mission's inputs from the file of a world",
    "missions": "an `alula.parts.MissionPart`: nodes of its own for [missions](mission-files.md)",
    "hooks": "the package whose hooks a replay from the functional layer runs",
    "report": (
        "a function that makes an `alula.parts.ReportPart`: numbers, pictures, what became of the mission's tasks, entries of the page"
    ),
    "run": "a class, an `alula.parts.RunPart`: what is the robot's own in a live run",
    "sensors": "a `SensorPart`, imported in the ROS 1 world: cores of nodes that perceive again in a replay from sensors",
    "areas": "a function that reads the areas of the page's map from the file of a world",
}
"""What a robot may add to the general commands, as ``module`` or ``module:name``; the texts are those of ``docs/reference/robots.md``."""
WORLD_KEYS: Mapping[str, Key] = {
    "packages": Key("folders of packages, found as colcon and catkin find them", "`ros1_ws/src`, `ros2_ws/src`"),
    "python": Key("a file of pinned Python packages, `name==version` a line"),
    "debian": Key("Debian packages"),
    "underlays": Key("workspaces or prefixes that are sourced [first](#underlays)"),
}
KEYS: Mapping[str, Key] = {
    "name": Key("a-z, 0-9 and `_`; names the generated client and the bridge's configuration", "needed"),
    "about": Key("a sentence"),
    "robots": Key("of a [fleet](../how-to/fleets.md): its robots' folders by name; it has no models itself", "none"),
    "skillsets": Key("folder of the models, with `types.yaml`, `bindings.yaml`, `mock.yaml`, `faults.yaml`", "`skillsets`"),
    "scenarios": Key("folder of [scenarios](../how-to/scenarios.md)", "`scenarios`"),
    "worlds": Key("folder of the files that scenarios name as `world`", "`worlds`"),
    "departure": Key("`skillset.resource STATE`: when the robot is away"),
    "taken": Key("`skillset.resource STATE`: when it is not the mission's any more"),
    "rest": Key("`skillset.resource STATE`: in which it may be left away from where it departed; else a campaign counts that as trouble"),
    "page": Key("words and facts of its [page and reports](#page)", "the usual words"),
    "python": Key("folders of plain Python packages that [parts](#what-a-robot-adds) are imported from"),
    "parts": Key("[what it adds](#what-a-robot-adds) to the general commands, as `module:name`"),
    "ros1": Key("what it has in ROS 1: see below"),
    "ros2": Key("what it has in ROS 2: see below"),
}
_NAME = re.compile(r"[a-z][a-z0-9_]*")


class RobotError(AlulaError):
    """There is no robot, or its file is wrong; the message says where and what to do."""


@dataclass(frozen=True)
class RosPart:
    """What a robot has in one ROS world.

    Attributes:
        packages: folders of packages that are built on top of Alula's.
        python: a file of pinned Python packages, None where no others are needed.
        debian: Debian packages.
        underlays: workspaces or prefixes that are sourced below, such as ``/opt/ros/jazzy``.
    """

    packages: tuple[Path, ...] = ()
    python: Path | None = None
    debian: tuple[str, ...] = ()
    underlays: tuple[Path, ...] = ()


@dataclass(frozen=True)
class RobotFolder:
    """A robot.

    Attributes:
        root: its folder.
        skillsets: the folder of its models, with ``types.yaml``, ``bindings.yaml``, ``mock.yaml`` and ``faults.yaml``.
        scenarios: the folder of its scenarios; ``worlds`` that of the files which scenarios name as their ``world``.
        departure: resource and state; times of a run count from when this state is left first, and a run that ends in it has come back.
        taken: resource and state; a robot that enters this state while it is away is not the mission's to bring back.
        rest: resource and state; a robot in this state may be left where it is: nobody has to bring it back.
        page: words and facts of its reports and of the operator's page, see `read_page`.
        python: folders of plain Python packages, which missions and the parts import.
        parts: what it adds to the general commands.
        robots: of a fleet, the robots that it consists of, by their names in it; what they have is called ``ROBOT_NAME`` in it.
    """

    root: Path
    name: str
    skillsets: Path
    scenarios: Path
    worlds: Path
    about: str = ""
    departure: tuple[str, str] | None = None
    taken: tuple[str, str] | None = None
    rest: tuple[str, str] | None = None
    page: Mapping[str, Any] = field(default_factory=lambda: dict(USUAL_PAGE))
    python: tuple[Path, ...] = ()
    parts: Mapping[str, str] = field(default_factory=dict)
    robots: Mapping[str, RobotFolder] = field(default_factory=dict)
    ros1: RosPart = RosPart()
    ros2: RosPart = RosPart()

    @property
    def runs(self) -> Path:
        """Return the folder that runs are put into when nothing else is asked for."""
        return self.root / "runs"

    def file(self, name: str) -> Path | None:
        """Return a file that goes with the models; None where the robot has none."""
        path = self.skillsets / name
        return path if path.is_file() else None

    @property
    def behaviour_files(self) -> list[Path]:
        """Return the file that says what its mocks do, none where it has none."""
        file = self.file(BEHAVIOUR)
        return [] if file is None else [file]

    def mocks_on_top(self, robot: str) -> list[Path]:
        """Return the file by which a fleet adds to what the mocks of one of its robots do, none where it has none."""
        file = self.root / "mocks" / f"{robot}.yaml"
        return [file] if file.is_file() else []

    def world(self, name: str) -> Path:
        """Return the file of a world, by its name or as a path."""
        return self.worlds / f"{name}.yaml" if name and name.isidentifier() else Path(name).expanduser()

    def part(self, name: str) -> Any:
        """Return what the robot adds to a general command; None where it adds nothing.

        Raises:
            RobotError: what its file names does not exist.
        """
        return self.load(self.parts[name]) if name in self.parts else None

    def import_path(self) -> None:
        """Put the robot's own packages on the import path."""
        _swap_code(self.python)
        own = [str(folder) for folder in self.python]
        # Before what is installed: the folder that was named is the robot.
        sys.path[:] = [*own, *(place for place in sys.path if place not in own)]

    def load(self, text: str) -> Any:
        """Return a module, or what ``module:name`` is; raises RobotError."""
        self.import_path()
        module, _, attribute = text.partition(":")
        try:
            loaded = importlib.import_module(module)
            return getattr(loaded, attribute) if attribute else loaded
        except (ImportError, AttributeError) as error:
            raise RobotError(f"{self.root / FILE}: {text} can't be imported: {error}") from error


_CODE: dict[Path, dict[str, ModuleType]] = {}
"""By each folder of packages of robots that were imported from: modules that were set aside, as another robot's have their names."""
_SWAPPING = threading.RLock()


def _swap_code(folders: Sequence[Path]) -> None:
    """Swap imported modules: unload those of other robots that have names of these folders' packages, and restore these folders' own."""
    with _SWAPPING:
        for folder in folders:
            _CODE.setdefault(folder, {})
        own = _packages_in(folders)
        for name, module in list(sys.modules.items()):
            place = _folder_of(module) if name.partition(".")[0] in own else None
            if place is not None and place not in folders:
                _CODE[place][name] = sys.modules.pop(name)
        for folder in folders:
            sys.modules.update(_CODE[folder])
            _CODE[folder].clear()
        importlib.invalidate_caches()


def _packages_in(folders: Iterable[Path]) -> set[str]:
    """Return the names of the packages and modules in folders; none of a folder that is not there."""
    found = set()
    for folder in folders:
        with contextlib.suppress(OSError), os.scandir(folder) as entries:
            found |= {entry.name.removesuffix(".py") for entry in entries if entry.is_dir() or entry.name.endswith(".py")}
    return found


def _folder_of(module: ModuleType) -> Path | None:
    """Return the folder of a robot's packages that a module was imported from, or None."""
    places = [getattr(module, "__file__", None) or "", *list(getattr(module, "__path__", ()))[:1]]
    place = next((Path(one) for one in places if one), None)
    within = [folder for folder in _CODE if place is not None and place.is_relative_to(folder)]
    return max(within, key=lambda folder: len(folder.parts), default=None)


_MEANT: ContextVar[RobotFolder | None] = ContextVar("robot", default=None)


@contextlib.contextmanager
def meaning(robot: RobotFolder | None) -> Iterator[None]:
    """Make `find_robot` return this robot within the context, in this thread; None: leave it as it is."""
    token = _MEANT.set(robot or _MEANT.get())
    try:
        yield
    finally:
        _MEANT.reset(token)


def find_robot(start: Path | None = None) -> RobotFolder:
    """Return the robot that is meant or was named, or the one of the current folder (``start``) or a folder above it.

    Raises:
        RobotError: there is none, or its file is wrong.
    """
    meant = _MEANT.get()
    if meant is not None and start is None:
        return meant
    named = os.environ.get(VARIABLE)
    if named and start is None:
        return load_robot_folder(Path(named).resolve())
    here = (start or Path.cwd()).resolve()
    for folder in (here, *here.parents):
        if (folder / FILE).is_file():
            return load_robot_folder(folder)
    raise RobotError(f"there is no {FILE} in {here} or above; name the robot's folder with --robot DIR, or make one: alula new robot DIR")


@public("alula.parts")
def load_part(name: str, robot: str | Path | None = None) -> Any:
    """Return what a robot's file names under ``parts``, as the commands take it; None where it names nothing.

    Args:
        name: of the part, such as ``missions`` or ``run``.
        robot: the robot's folder; None: that of the current folder or above.

    Raises:
        RobotError: there is no robot, or what its file names does not exist.
    """
    return (find_robot() if robot is None else load_robot_folder(Path(robot).resolve())).part(name)


def robots_of_fleet() -> Mapping[str, RobotFolder]:
    """Return the robots of the fleet that commands are about; none where they are about a robot, or there is none."""
    try:
        return find_robot().robots
    except RobotError:
        return {}


def page_words() -> Mapping[str, Any]:
    """Return the robot's words for its reports; the usual ones where there is no robot, as for a run from elsewhere."""
    try:
        return find_robot().page
    except RobotError:
        return USUAL_PAGE


def load_robot_folder(root: Path) -> RobotFolder:
    """Read a robot's file; raises RobotError."""
    path = root / FILE
    try:
        written_ns = path.stat().st_mtime_ns
    except OSError as error:
        raise RobotError(f"{path}: {error.strerror}; name the robot's folder with --robot DIR, or make one: alula new robot DIR") from None
    return _load(root, written_ns)


@functools.lru_cache(maxsize=16)
def _load(root: Path, _written_ns: int) -> RobotFolder:
    document = read_yaml(root / FILE, RobotError)
    if document is None:
        raise RobotError(f"{root / FILE}: is empty; a robot needs a name")
    said = document.record("a robot", KEYS)
    if "name" not in said:
        raise document.wrong("a robot needs `name`")
    name = said["name"].text("`name`")
    if _NAME.fullmatch(name) is None:
        raise said["name"].wrong(f"`{name}`: a robot's name is made of a-z, 0-9 and _, and begins with a letter")
    folder: Callable[[str, str], Path] = lambda key, default: root / (said[key].text(f"`{key}`") if key in said else default)  # noqa: E731
    return RobotFolder(
        root=root,
        name=name,
        about=said["about"].text("`about`") if "about" in said else "",
        skillsets=_existing(said, "skillsets", folder("skillsets", "skillsets")),
        scenarios=folder("scenarios", "scenarios"),
        worlds=folder("worlds", "worlds"),
        departure=_state(said, "departure"),
        taken=_state(said, "taken"),
        rest=_state(said, "rest"),
        page=read_page(said.get("page")),
        python=tuple(root / one for one in _texts(said.get("python"), "`python`")),
        parts=_parts(said.get("parts")),
        robots=_robots(root, said),
        ros1=_ros_part(root, said.get("ros1"), "ros1_ws/src"),
        ros2=_ros_part(root, said.get("ros2"), "ros2_ws/src"),
    )


def fleet_name(robot: str, name: str) -> str:
    """Return what a skillset or a fault of a robot is called in a fleet."""
    return f"{robot}_{name}"


def _robots(root: Path, said: Mapping[str, Located]) -> dict[str, RobotFolder]:
    """Return the robots of a fleet; none of a robot."""
    found: dict[str, RobotFolder] = {}
    for name, entry in said["robots"].entries("`robots`").items() if "robots" in said else ():
        if _NAME.fullmatch(name) is None:
            raise entry.wrong(f"`{name}`: a robot's name is made of a-z, 0-9 and _, and begins with a letter")
        found[name] = load_robot_folder((root / Path(entry.text(f"the folder of {name}")).expanduser()).resolve())
        if found[name].robots:
            raise entry.wrong(f"{name} is a fleet itself; name its robots")
    if found and "skillsets" in said:
        raise said["skillsets"].wrong("a fleet has the skillsets of its robots, and none of its own; leave `skillsets` out")
    return found


def _existing(said: Mapping[str, Located], key: str, path: Path) -> Path:
    if key in said and not path.is_dir():
        raise said[key].wrong(f"`{key}`: {path} is no folder")
    return path


def _texts(part: Located | None, what: str) -> tuple[str, ...]:
    return () if part is None else tuple(one.text(f"an entry of {what}") for one in part.elements())


def _state(said: Mapping[str, Located], key: str) -> tuple[str, str] | None:
    """Return resource and state, which stand as ``skillset.resource STATE``."""
    if key not in said:
        return None
    place, _, state = said[key].text(f"`{key}`").partition(" ")
    resource = place.rpartition(".")[2]
    if not resource or not state.isidentifier():
        raise said[key].wrong(f"`{key}` should be skillset.resource STATE, such as base.base_status DOCKED")
    return resource, state


def _parts(part: Located | None) -> dict[str, str]:
    return {} if part is None else {name: one.text(f"`{name}`") for name, one in part.record("`parts`", PARTS).items()}


def _ros_part(root: Path, part: Located | None, default: str) -> RosPart:
    said = {} if part is None else part.record("what a robot has in a ROS world", WORLD_KEYS)
    packages = _texts(said["packages"], "`packages`") if "packages" in said else (default,)
    python = root / said["python"].text("`python`") if "python" in said else None
    if python is not None and not python.is_file():
        raise said["python"].wrong(f"`python`: there is no file {python}")
    underlays = tuple((root / Path(one).expanduser()) for one in _texts(said.get("underlays"), "`underlays`"))
    for underlay in underlays:
        if not underlay.is_dir():
            raise said["underlays"].wrong(f"`underlays`: {underlay} is no folder")
    return RosPart(tuple(root / one for one in packages), python, _texts(said.get("debian"), "`debian`"), underlays)


def wrong_world(robot: RobotFolder, name: str) -> str:
    """Return what to say of a world that is not there."""
    known = sorted(path.stem for path in robot.worlds.glob("*.yaml"))
    return f"there is no world {name}; there are {choices(name, known)}, or give a file"
