"""What the operator can do without the mission: start a run, and switch everything off."""

from __future__ import annotations

import contextlib
import json
import os
import re
import signal
import subprocess
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timezone
from pathlib import Path

from alula.common.faults import FaultError, parse_fault
from alula.common.located_yaml import YamlError, read_yaml
from alula.common.processes import end_run
from alula.common.robots import find_robot
from alula.common.runs import runs_folder
from alula.common.scenarios import scenario_names
from alula.console.link import ActError
from alula.report.aborts import OPERATOR, ReportedAbort, note_abort
from alula.runtime.live.options import RunOption, entry, words_of
from alula.runtime.live.spec import RequestError

SILENT_S = 120.0  # wall clock; before a run begins it may have to build what has changed, and says each step
END_S = 5.0
LOOK_S = 0.05
MAX_FAULTS = 8
LIVE, MOCKS = "live", "mocks"
_WORD = re.compile(r"[A-Za-z0-9_:.@-]{1,60}")
_WORLD = re.compile(r"[^\x00-\x1f-][^\x00-\x1f]{0,300}")


@dataclass(frozen=True)
class WantedRun:
    """A run that the operator requests. ``world``: a name or a file, empty for the scenario's; ``options``: the robot's own, by name."""

    scenario: str
    seed: int
    faults: tuple[str, ...] = ()
    world: str = ""
    mock: bool = False
    options: tuple[str, ...] = ()

    def words(self, out: Path) -> list[str]:
        """Return the command that starts this run with ``out`` as its folder."""
        words = [entry(), "run", self.scenario, "--seed", str(self.seed), "--out", str(out)]
        for fault in self.faults:
            words += ["--fail", fault]
        words += [f"--world={self.world}"] if self.world else []
        return [*words, *self.options, *(["--mock"] if self.mock else [])]


def world_names() -> list[str]:
    """Return the robot's worlds."""
    return sorted(path.stem for path in find_robot().worlds.glob("*.yaml"))


def read_wanted(asked: Mapping[str, object], known: Sequence[RunOption]) -> WantedRun:
    """Return the run that a request describes; ``known`` are the robot's own options, whose values `alula run` checks.

    Raises:
        ActError: the request is malformed.
    """
    scenario, seed = asked.get("scenario"), asked.get("seed", 0)
    if scenario not in scenario_names():
        raise ActError(f"there is no scenario {scenario!r}; there are {', '.join(scenario_names())}")
    if not isinstance(seed, int) or isinstance(seed, bool) or not 0 <= seed < 2**31:
        raise ActError(f"the seed has to be a whole number from 0 to {2**31 - 1}")
    over = asked.get("over", LIVE)
    if over not in {LIVE, MOCKS}:
        raise ActError(f"a run is {LIVE} or over {MOCKS}, not {over!r}")
    world = _text(asked, "world", _WORLD, "is no world; give a name, or a file that does not begin with a dash")
    _check_world(world)
    options = _options(asked.get("options", {}), known)
    return WantedRun(str(scenario), seed, _faults(asked.get("faults", [])), world, over == MOCKS, options)


def _options(given: object, known: Sequence[RunOption]) -> tuple[str, ...]:
    if not isinstance(given, dict) or not all(isinstance(value, str) for value in given.values()):
        raise ActError("options are texts by their names")
    try:
        return tuple(words_of(given, known))
    except RequestError as error:
        raise ActError(str(error)) from error


def _check_world(world: str) -> None:
    """Refuse a file that is no world before `alula run` does so: its messages quote what stands there, and any file can be asked for.

    A world has something of what all worlds of the robot have.
    """
    if not world or world in world_names():
        return
    of_all = [_keys(path) for path in find_robot().worlds.glob("*.yaml")]
    if not of_all or not _keys(Path(world)).intersection(*of_all):
        raise ActError(
            f"{world} is no world: give one of {', '.join(world_names())}, or a YAML file on the robot's computer that is like them"
        )


def _keys(path: Path) -> set[str]:
    try:
        read = read_yaml(path) if path.is_file() else None
        return set() if read is None else {str(key) for key in read.entries("a world")}
    except (YamlError, OSError):
        return set()


def _text(asked: Mapping[str, object], name: str, pattern: re.Pattern[str], why: str) -> str:
    text = asked.get(name, "")
    if not isinstance(text, str) or (text and not pattern.fullmatch(text)):
        raise ActError(f"{text!r} {why}")
    return text


def _faults(faults: object) -> tuple[str, ...]:
    if not isinstance(faults, list) or len(faults) > MAX_FAULTS:
        raise ActError(f"faults are a list of at most {MAX_FAULTS}")
    for fault in faults:
        if not isinstance(fault, str) or not _WORD.fullmatch(fault):
            raise ActError(f"{fault!r} is no fault; one looks like WHAT@30 or WHAT:HOW@30-40")
        try:
            parse_fault(fault)
        except FaultError as error:
            raise ActError(str(error)) from error
    return tuple(faults)


def start(wanted: WantedRun) -> Path:
    """Start a run and return its folder, as soon as that is there.

    The run is a process of its own that this one does not end: a vehicle in the air must not fall because a page's server ended. Only
    one that has printed nothing for SILENT_S and has not begun is ended: who sees that it has not started may start another one.

    Raises:
        ActError: it does not start; the message is its own.
    """
    out = runs_folder() / f"{datetime.now(tz=timezone.utc).astimezone():%Y%m%d-%H%M%S}-{wanted.scenario}"
    runs_folder().mkdir(parents=True, exist_ok=True)
    said = runs_folder() / f".{out.name}.log"
    with said.open("wb") as log:
        process = subprocess.Popen(wanted.words(out), stdin=subprocess.DEVNULL, stdout=log, stderr=log, start_new_session=True)
    length, since_s = 0, time.monotonic()
    while not (out / "run.json").exists():
        if said.stat().st_size > length:
            length, since_s = said.stat().st_size, time.monotonic()
        late = time.monotonic() - since_s >= SILENT_S
        if late:
            end(process)
        if process.poll() is not None:
            words = said.read_text(encoding="utf-8", errors="replace").strip().splitlines()
            last = words[-1] if words else "it said nothing" if late else f"alula run ended with {process.returncode}"
            silence = f"the run had not begun, said nothing for {SILENT_S:g} s and was ended; its last words: " if late else ""
            raise ActError(f"{silence}{last}")
        time.sleep(LOOK_S)
    return out


def end(process: subprocess.Popen[bytes]) -> None:
    """End a process that a page has started, with all its children."""
    for one in (signal.SIGTERM, signal.SIGKILL):
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, one)
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(END_S)
            return


def everything_off(folder: Path) -> str:
    """End all processes of a run at once, without landing; return what was done."""
    note_abort(folder, ReportedAbort(OPERATOR, "everything off"))
    run_id = str(json.loads((folder / "run.json").read_text(encoding="utf-8"))["run_id"])
    ended = end_run(run_id, timeout_s=0.0)
    return f"{len(ended)} processes were ended at once"
