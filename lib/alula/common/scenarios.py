"""The scenarios of a robot: ``scenarios/NAME.yaml`` says of each everything that it is made of (docs/how-to/scenarios.md)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from alula.common.errors import AlulaError
from alula.common.keys import Key
from alula.common.located_yaml import Located, read_yaml
from alula.common.public import public
from alula.common.robots import RobotError, find_robot
from alula.common.suggestions import with_nearest

NEEDED = ("about", "skillsets")
KEYS: Mapping[str, Key] = {
    "about": Key("a sentence", "needed"),
    "world": Key("name or file of what the mission takes place in, with its inputs; `--world` names another one"),
    "mission": Key("the file of its tree, as `missions/patrol.xml`", "[none](#without-a-mission)"),
    "skillsets": Key("whose managers are started", "needed"),
    "launch": Key("launch file of ROS 1, `package/file`; started by hand it runs the scenario, too", "over mocks only"),
    "report": Key("parts of the report that the robot adds, such as a map"),
    "faults": Key("what can fail besides what the robot's own options say, and how: `door: [stuck, slow]`, `planner: [killed, hung]`"),
    "processes": Key("which of them are processes, which can be `killed` or `hung`, and their nodes: `planner: route_planner`"),
    "fallback": Key("the skill whose running makes the robot safe after a failure"),
    "motion": Key("the skills that take it on then"),
    "robots": Key("of a fleet: how each robot serves its skills ([fleets](fleets.md))"),
    "library": Key("folders and files, from this file on, whose trees the mission may use without including them: `[../trees]`"),
}
"""What a scenario may say."""


class ScenarioError(AlulaError):
    """A scenario does not exist or its file is wrong; the message says what would be right."""


@public("alula.parts")
@dataclass(frozen=True)
class Scenario:
    """A scenario of a robot: a mission, its world, its skillsets and its launch file.

    Attributes:
        name: as on the command line.
        about: in a sentence.
        world: name or file of the robot's worlds, unless another is asked for; the mission's inputs come from it.
        skillsets: the skillsets whose managers are started.
        mission: the file of its tree, from the robot's folder; empty: the robot only serves its skills, until the run is ended.
        launch: ``package/file`` for roslaunch.
        report: parts of the report, of those that the robot has.
        faults: what can fail besides what the robot's own options say, each with the ways in which it can.
        processes: which of those faults are of a process, and its node in the launch file.
        fallback: the skill whose running means that the robot is safe again after a failure.
        motion: the skills that take it on then.
        robots: of a fleet, the scenario without a mission by which each robot serves its skills.
        library: folders and files whose trees the mission may use without including them; the file says them from where it lies on.
    """

    name: str
    about: str
    skillsets: tuple[str, ...]
    mission: str = ""
    world: str = ""
    launch: str = ""
    report: tuple[str, ...] = ()
    faults: tuple[tuple[str, tuple[str, ...]], ...] = ()
    processes: tuple[tuple[str, str], ...] = ()
    fallback: str = ""
    motion: tuple[str, ...] = ()
    robots: tuple[tuple[str, str], ...] = ()
    library: tuple[Path, ...] = ()


def scenarios_folder() -> Path:
    """Return the folder of the robot's scenarios; raises ScenarioError where there is no robot."""
    try:
        return find_robot().scenarios
    except RobotError as error:
        raise ScenarioError(str(error)) from None


def scenario_names(folder: Path | None = None) -> list[str]:
    """Return the names of the robot's scenarios."""
    return sorted(path.stem for path in (folder or scenarios_folder()).glob("*.yaml"))


def mission_names(folder: Path | None = None) -> list[str]:
    """Return the scenarios with a mission: all that do not only serve the robot's skills; raises ScenarioError."""
    return [name for name in scenario_names(folder) if load_scenario(name, folder).mission]


def load_scenario(name: str, folder: Path | None = None) -> Scenario:
    """Read a scenario; raises ScenarioError."""
    names = scenario_names(folder)
    if name not in names:
        raise ScenarioError(with_nearest(f"there is no scenario '{name}'", name, names))
    path = (folder or scenarios_folder()) / f"{name}.yaml"
    document = read_yaml(path, ScenarioError)
    if document is None:
        raise ScenarioError(f"{path}: is empty; a scenario needs {', '.join(NEEDED)}")
    said = document.record("a scenario", KEYS)
    for key in NEEDED:
        if key not in said:
            raise document.wrong(f"a scenario needs `{key}`")
    mission = said["mission"].text("`mission`") if "mission" in said else ""
    if mission and not mission.endswith(".xml") and mission.count(":") != 1:
        raise said["mission"].wrong(f"`mission` should be a file as missions/{name}.xml, or module:function, not {mission}")
    report = _words(said, "report")
    faults = said["faults"].entries("`faults`") if "faults" in said else {}
    processes = said["processes"].entries("`processes`") if "processes" in said else {}
    for what, node in processes.items():
        if what not in faults:
            raise node.wrong(f"`faults` does not say in which ways {what} can fail")
    return Scenario(
        name=name,
        about=said["about"].text("`about`"),
        world=said["world"].text("`world`") if "world" in said else "",
        mission=mission,
        skillsets=_words(said, "skillsets"),
        launch=_launch(said.get("launch")),
        report=report,
        faults=tuple((what, tuple(way.text("a way to fail") for way in ways.elements())) for what, ways in faults.items()),
        processes=tuple((what, node.text("the node of a process")) for what, node in processes.items()),
        fallback=said["fallback"].text("`fallback`") if "fallback" in said else "",
        motion=_words(said, "motion"),
        robots=tuple((name, one.text(f"the scenario of {name}")) for name, one in said["robots"].entries("`robots`").items())
        if "robots" in said
        else (),
        library=_library(said.get("library"), path.parent),
    )


def _launch(part: Located | None) -> str:
    if part is None:
        return ""
    text = part.text("`launch`")
    if text.count("/") != 1:
        raise part.wrong(f"`launch` should be package/file.launch, not {text}")
    return text


def _library(part: Located | None, around: Path) -> tuple[Path, ...]:
    found = {} if part is None else {around / one.text("an entry of `library`"): one for one in part.elements()}
    for place, one in found.items():
        if not place.exists():
            raise one.wrong(f"there is no folder {place}; the path counts from this file on")
    return tuple(found)


def _words(said: dict[str, Located], key: str) -> tuple[str, ...]:
    return tuple(part.text(f"an entry of `{key}`") for part in said[key].elements()) if key in said else ()
