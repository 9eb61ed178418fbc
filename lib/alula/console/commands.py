"""What viewers may ask the server to do: what a request means, and what of it goes into the run's record."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from alula.common.robots import RobotError, find_robot
from alula.common.runs import NoRunError, Run, is_deployment, live_runs, load_run, robot_of
from alula.common.scenarios import ScenarioError
from alula.console import acts
from alula.console.link import ActError, Link, Mission, PerRun
from alula.console.manual_control import QUESTIONS, ManualControl
from alula.console.searches import Searches, words_for
from alula.runtime.live.options import RunOption

ON_THE_FLIGHT = frozenset({"abort", "pause", "resume", "off"})
"""Acts of which each is begun once: a request that comes while the act is under way gets the same answer."""


@dataclass(frozen=True)
class Done:
    """What was done, in words, in which run, and the answer; ``noted``: it belongs into that run's record."""

    run: Path
    what: str
    answer: str
    noted: bool = True


Asked = Mapping[str, Any]


class Commands:
    """The operator's commands by name. They block until they are answered: call them in threads. ``name_of`` names a run for viewers."""

    def __init__(self, link: Link, options: Callable[[], Sequence[RunOption]], name_of: Callable[[Path], str]) -> None:
        self._options = options
        self._name_of = name_of
        self.searches = Searches()
        self._missions: PerRun[Mission] = PerRun(link.connect)
        self._controls: PerRun[ManualControl] = PerRun(lambda run: ManualControl(link.listen(run)))
        self._acts: Mapping[str, Callable[[Asked, Path | None], Done]] = {
            "start": self._start,
            "abort": lambda asked, run: self._told("abort", asked, run, lambda mission: mission.abort()),
            "pause": lambda asked, run: self._told("pause", asked, run, lambda mission: mission.set_paused(paused=True)),
            "resume": lambda asked, run: self._told("resume", asked, run, lambda mission: mission.set_paused(paused=False)),
            "off": self._off,
            "skill": self._skill,
            "search": self._search,
            "stop search": self._stop_search,
        }

    def do(self, command: str, asked: Asked, run: Path | None) -> Done:
        """Execute a command; ``run`` is the one that the viewer sees.

        Raises:
            ActError, NoRunError, OSError: the command can't be executed.
        """
        if command not in self._acts:
            raise ActError(f"there is no command {command}")
        return self._acts[command](asked, run)

    def manual_control_of(self, run: Path) -> ManualControl:
        """Return the manual control of a run under way; its skillsets are listened to from the first call on."""
        return self._controls.of(load_run(run))

    def keep(self, watched: set[Path], manual: set[Path]) -> None:
        """Connect to the missions of the watched runs, ahead of any command; close the connections to all others.

        Listen to no skillsets but those of the runs under manual control: listening costs.
        """
        missions = _runs_of(watched)
        for run in missions:
            self._missions.of(run)
        self._missions.keep(missions)
        self._controls.keep(_runs_of(manual))

    def _start(self, asked: Asked, _run: Path | None) -> Done:
        folder = acts.start(acts.read_wanted(asked, self._options()))
        return Done(folder, "start", f"{folder.name} is started")

    def _told(self, what: str, asked: Asked, run: Path | None, act: Callable[[Mission], str]) -> Done:
        folder = self._confirmed(asked, run, mission=True)
        return Done(folder, what, act(self._missions.of(load_run(folder))))

    def _off(self, asked: Asked, run: Path | None) -> Done:
        folder = self._confirmed(asked, run, mission=True)
        return Done(folder, "off", acts.everything_off(folder))

    def _skill(self, asked: Asked, run: Path | None) -> Done:
        folder = self._confirmed(asked, run)
        what, answer = self.manual_control_of(folder).do(asked)
        return Done(folder, what, answer, noted=asked.get("act") not in QUESTIONS)

    def _search(self, asked: Asked, run: Path | None) -> Done:
        """Look for what could have been done about a fault; beside a mission under way only where that is asked for."""
        folder = self._shown(asked, run)
        if asked.get("beside") is not True and any(not is_deployment(one.folder) for one in live_runs()):
            raise ActError("a mission under way on this computer would miss the processor; wait for its end, or ask for a search beside it")
        self.searches.start(folder, str(asked.get("fault")), _words_of_search(folder, asked.get("fault")))
        return Done(folder, "search", f"what could have been done about {asked['fault']} is being looked for", noted=False)

    def _stop_search(self, asked: Asked, run: Path | None) -> Done:
        folder = self._shown(asked, run)
        self.searches.stop(folder, str(asked.get("fault")))
        return Done(folder, "stop search", "it ends with what it has", noted=False)

    def _shown(self, asked: Asked, run: Path | None) -> Path:
        """Return the run that a command means; raise ActError unless the request names the very run that is shown."""
        if run is None or asked.get("run") != self._name_of(run):
            raise ActError("the run that is shown is another one by now; look again")
        return run

    def _confirmed(self, asked: Asked, run: Path | None, *, mission: bool = False) -> Path:
        """Return the run under way that a command means, as ``_shown``; ``mission``: one's."""
        folder = self._shown(asked, run)
        if not is_live(folder):
            raise ActError("this run is over")
        if mission and is_deployment(folder):
            raise ActError("this is what stays up between missions: choose the mission's run; alula down ends what stays up")
        return folder


def _words_of_search(folder: Path, fault: object) -> list[str]:
    """Return the command that answers a fault of a run; raise ActError where the run does not name its mission."""
    try:
        scenario = str(json.loads((folder / "run.json").read_text(encoding="utf-8"))["scenario"])
        return words_for(robot_of(folder) or find_robot(), scenario, fault)
    except (OSError, ValueError, KeyError, RobotError, ScenarioError) as error:
        raise ActError(f"what was flown is not known: {error}") from error


def _runs_of(folders: set[Path]) -> set[Run]:
    runs = set()
    for folder in folders:
        with contextlib.suppress(NoRunError):
            runs.add(load_run(folder))
    return runs


def is_live(folder: Path) -> bool:
    """Return whether a run is under way."""
    try:
        return not (folder / "summary.json").exists() and load_run(folder).live
    except NoRunError:
        return False


def runs_in(folders: Iterable[Path], fixed: Path | None) -> list[Path]:
    """Return the folders of runs, the newest first, and of a fleet its mission's before its robots'; ``fixed`` is one, wherever it lies."""
    found = {path.parent for folder in folders for path in folder.glob("*/run.json")} | ({fixed} if fixed is not None else set())
    stamped = []
    for path in found:
        with contextlib.suppress(OSError):
            whole = path.parent if path.parent in found else path
            stamped.append(((whole / "run.json").stat().st_mtime, path == whole, path))
    return [path for *_, path in sorted(stamped, reverse=True)]
