"""What viewers may ask the server to do: what a request means, and what of it goes into the run's record."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from threading import Lock
from typing import Any

from alula.common.runs import NoRunError, load_run
from alula.console import acts
from alula.console.acts import ActError
from alula.console.hands import QUESTIONS, Hands


@dataclass(frozen=True)
class Done:
    """What was done, in words, in which run, and the answer; ``noted``: it belongs into that run's record."""

    run: Path
    what: str
    answer: str
    noted: bool = True


Asked = Mapping[str, Any]


class Commands:
    """The acts by name. They wait for answers, so they are called in threads."""

    def __init__(self) -> None:
        self._hands: dict[Path, Hands] = {}
        self._lock = Lock()
        self._acts: Mapping[str, Callable[[Asked, Path | None], Done]] = {
            "start": self._start,
            "abort": lambda asked, run: _done("abort", asked, run, acts.abort),
            "pause": lambda asked, run: _done("pause", asked, run, acts.pause),
            "resume": lambda asked, run: _done("resume", asked, run, acts.resume),
            "off": lambda asked, run: _done("off", asked, run, acts.everything_off),
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

    def hands_on(self, run: Path) -> Hands:
        """Return the skillsets of a run under way, to be driven by hand; they are listened to from the first call on."""
        with self._lock:
            if run not in self._hands:
                self._hands[run] = Hands(load_run(run).domain)
            return self._hands[run]

    def hands_off(self, keep: set[Path]) -> None:
        """End listening to the skillsets of runs other than these."""
        with self._lock:
            leaving = [self._hands.pop(run) for run in set(self._hands) - keep]
        for hands in leaving:
            hands.close()

    def _start(self, asked: Asked, _run: Path | None) -> Done:
        folder = acts.start(acts.read_flight(asked))
        return Done(folder, "start", f"{folder.name} is started")

    def _skill(self, asked: Asked, run: Path | None) -> Done:
        folder = _confirmed(asked, run)
        what, answer = self.hands_on(folder).do(asked)
        return Done(folder, what, answer, noted=asked.get("act") not in QUESTIONS)


def _done(what: str, asked: Asked, run: Path | None, act: Callable[[Path], str]) -> Done:
    folder = _confirmed(asked, run)
    return Done(folder, what, act(folder))


def _confirmed(asked: Asked, run: Path | None) -> Path:
    """Return the run that a command means; raise ActError unless the request names the very run that is shown."""
    if run is None or asked.get("run") != run.name:
        raise ActError("the run that is shown is another one by now; look again")
    if not is_live(run):
        raise ActError("this run is over")
    return run


def is_live(folder: Path) -> bool:
    """Tell whether a run is under way."""
    try:
        return load_run(folder).live and not (folder / "summary.json").exists()
    except NoRunError:
        return False


def runs_in(folder: Path, fixed: Path | None) -> list[Path]:
    """Return the folders of runs, the newest first; ``fixed`` is one, wherever it lies."""
    found = {path.parent for path in folder.glob("*/run.json")} | ({fixed} if fixed is not None else set())
    stamped = []
    for path in found:
        with contextlib.suppress(OSError):
            stamped.append(((path / "run.json").stat().st_mtime, path))
    return [path for _, path in sorted(stamped, reverse=True)]
