"""The scenarios that can be flown: ``scenarios/NAME.yaml`` says of each everything that it is made of (docs/scenarios.md)."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from alula.common.located_yaml import Located, choices, read_yaml
from alula.common.suggestions import nearest

KEYS = ("about", "world", "mission", "skillsets", "launch", "report", "faults", "processes", "fallback", "motion")
PARTS = ("map", "video")
"""What a report can have besides what every flight has."""


class ScenarioError(Exception):
    """A scenario does not exist or its file is wrong; the message says what would be right."""


@dataclass(frozen=True)
class Scenario:
    """One scenario.

    Attributes:
        name: as on the command line.
        about: in a sentence.
        world: name or file of the world that is flown in unless another is asked for; its route is the mission's.
        mission: ``module:function`` of the ROS 2 world that makes the plan (tree and skillsets) of a route.
        skillsets: the skillsets whose managers are started.
        launch: launch file of uav_bringup.
        report: parts of the report.
        faults: what can fail besides the sensors, each with the ways in which it can.
        processes: which of those faults are of a process, and its node in the launch file.
        fallback: the skill whose running means that the vehicle is safe again after a failure.
        motion: the skills that take it on then.
    """

    name: str
    about: str
    world: str
    mission: str
    skillsets: tuple[str, ...]
    launch: str
    report: tuple[str, ...] = ()
    faults: tuple[tuple[str, tuple[str, ...]], ...] = ()
    processes: tuple[tuple[str, str], ...] = ()
    fallback: str = ""
    motion: tuple[str, ...] = ()


def scenarios_folder() -> Path:
    """Return the folder of this checkout's scenarios."""
    return Path(os.environ.get("ALULA_ROOT", ".")) / "scenarios"


def scenario_names(folder: Path | None = None) -> list[str]:
    """Return what can be flown."""
    return sorted(path.stem for path in (folder or scenarios_folder()).glob("*.yaml"))


def load_scenario(name: str, folder: Path | None = None) -> Scenario:
    """Read a scenario; raises ScenarioError."""
    names = scenario_names(folder)
    if name not in names:
        raise ScenarioError(f"there is no scenario '{name}'; {nearest(name, names)}")
    path = (folder or scenarios_folder()) / f"{name}.yaml"
    document = read_yaml(path, ScenarioError)
    if document is None:
        raise ScenarioError(f"{path}: is empty; a scenario needs about, world, mission, skillsets and launch")
    said = document.record("a scenario", KEYS)
    for key in ("about", "world", "mission", "skillsets", "launch"):
        if key not in said:
            raise document.wrong(f"a scenario needs `{key}`")
    mission = said["mission"].text("`mission`")
    if mission.count(":") != 1:
        raise said["mission"].wrong(f"`mission` should be module:function, not {mission}")
    report = _words(said, "report")
    for part in report:
        if part not in PARTS:
            raise said["report"].wrong(f"there is no part `{part}` of a report; there are {choices(part, PARTS)}")
    faults = said["faults"].entries("`faults`") if "faults" in said else {}
    processes = said["processes"].entries("`processes`") if "processes" in said else {}
    for what, node in processes.items():
        if what not in faults:
            raise node.wrong(f"`faults` does not say in which ways {what} can fail")
    return Scenario(
        name=name,
        about=said["about"].text("`about`"),
        world=said["world"].text("`world`"),
        mission=mission,
        skillsets=_words(said, "skillsets"),
        launch=said["launch"].text("`launch`"),
        report=report,
        faults=tuple((what, tuple(way.text("a way to fail") for way in ways.elements())) for what, ways in faults.items()),
        processes=tuple((what, node.text("the node of a process")) for what, node in processes.items()),
        fallback=said["fallback"].text("`fallback`") if "fallback" in said else "",
        motion=_words(said, "motion"),
    )


def _words(said: dict[str, Located], key: str) -> tuple[str, ...]:
    return tuple(part.text(f"an entry of `{key}`") for part in said[key].elements()) if key in said else ()
