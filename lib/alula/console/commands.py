"""What viewers may ask the server to do: what a request means, and what of it goes into the run's record."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from alula.common.runs import NoRunError, Run, is_deployment, load_run
from alula.console import acts
from alula.console.link import ActError, Link, Mission, PerRun
from alula.console.manual_control import QUESTIONS, ManualControl
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
    """The acts by name. They wait for answers, so they are called in threads. ``name_of`` returns what viewers call a run."""

    def __init__(self, link: Link, options: Callable[[], Sequence[RunOption]], name_of: Callable[[Path], str]) -> None:
        self._options = options
        self._name_of = name_of
        self._missions: PerRun[Mission] = PerRun(link.connect)
        self._controls: PerRun[ManualControl] = PerRun(lambda run: ManualControl(link.listen(run)))
        self._acts: Mapping[str, Callable[[Asked, Path | None], Done]] = {
            "start": self._start,
            "abort": lambda asked, run: self._told("abort", asked, run, lambda mission: mission.abort()),
            "pause": lambda asked, run: self._told("pause", asked, run, lambda mission: mission.set_paused(paused=True)),
            "resume": lambda asked, run: self._told("resume", asked, run, lambda mission: mission.set_paused(paused=False)),
            "off": self._off,
            "skill": self._skill,
        }

    def do(self, command: str, asked: Asked, run: Path | None) -> Done:
        """Do it; ``run`` is the one that the viewer sees.

        Raises:
            ActError, NoRunError, OSError: it can't be done.
        """
        if command not in self._acts:
            raise ActError(f"there is no command {command}")
        return self._acts[command](asked, run)

    def manual_control_of(self, run: Path) -> ManualControl:
        """Return the manual control of a run under way; its skillsets are listened to from the first call on."""
        return self._controls.of(load_run(run))

    def keep(self, watched: set[Path], manual: set[Path]) -> None:
        """Be connected to the missions of the runs that are watched, ahead of any command, and to no others.

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

    def _confirmed(self, asked: Asked, run: Path | None, *, mission: bool = False) -> Path:
        """Return the run that a command means; raise ActError unless the request names the very run that is shown; ``mission``: one's."""
        if run is None or asked.get("run") != self._name_of(run):
            raise ActError("the run that is shown is another one by now; look again")
        if not is_live(run):
            raise ActError("this run is over")
        if mission and is_deployment(run):
            raise ActError("this is what stays up between missions: choose the mission's run; alula down ends what stays up")
        return run


def _runs_of(folders: set[Path]) -> set[Run]:
    runs = set()
    for folder in folders:
        with contextlib.suppress(NoRunError):
            runs.add(load_run(folder))
    return runs


def is_live(folder: Path) -> bool:
    """Tell whether a run is under way."""
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
