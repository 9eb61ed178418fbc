"""The part of `alula check --play` that is about missions: the counterexample is flown in virtual time, and leaves a run's folder."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping
from pathlib import Path

from alula.api.checking import CheckedMission, checked_files, prove_missions
from alula.cli.run_request import run_folder
from alula.cli.saying import warner
from alula.common.files import json_line
from alula.common.run_log import note_mocked
from alula.language.errors import has_errors
from alula.missions.director import Outcome
from alula.prove.mission.run import MissionFinding
from alula.report.page.writing import write_report
from alula.runtime.live.spec import RequestError

COMMAND = "alula check"


def play_mission(options: argparse.Namespace, enums: Mapping[str, float]) -> int:
    """Play the counterexample of a mission, whose scripts may use ``enums``; return the exit code."""
    checked = checked_files(
        options.files,
        palettes=options.palette,
        main=options.main,
        packages=options.package,
        enums=enums,
        on_progress=warner(COMMAND),
    )
    files = [file for file in checked if isinstance(file, CheckedMission)]
    if len(files) < len(checked):
        return _refused("--play takes missions or models, not both at once")
    if any(has_errors(file.findings) for file in files):
        return _refused(f"a mission has errors; `alula check {' '.join(options.files)}` shows them")
    prove_missions(files, options.time, warner(COMMAND))
    found = [(file, one) for file in files for one in file.findings if isinstance(one, MissionFinding) and one.run is not None]
    if not 1 <= options.play <= len(found):
        return _refused(f"there is no counterexample {options.play}; these missions have {len(found) or 'none'}")
    file, finding = found[options.play - 1]
    try:
        folder = run_folder(options.out, Path(file.path).stem)
        folder.mkdir(parents=True, exist_ok=True)
        return _flown(file, finding, folder, as_json=options.json)
    except (RequestError, OSError) as error:
        return _refused(str(error))


def _flown(file: CheckedMission, finding: MissionFinding, folder: Path, *, as_json: bool) -> int:
    from alula.prove.mission.play import play  # with what it brings along

    assert finding.run is not None  # noqa: S101 - the caller has seen to it
    assert file.mission is not None  # noqa: S101 - it was proved
    played = play(file.mission, finding.run, folder)
    note_mocked(folder, played.simulated_s, 0.0, (), [played.left] if played.left else [])
    write_report(folder, title=f"{file.source.path.name}: {finding.code}, played")
    title = f"{finding.span}: {finding.code}: {finding.message}"
    if as_json:
        told = {
            "finding": title,
            "agrees": not played.left,
            "left": played.left,
            "outcome": played.end.outcome.value,
            "folder": str(folder),
        }
        sys.stdout.write(json_line(told))
    else:
        goes_on = finding.run.outcome == Outcome.RUNNING.value
        same = "situation" if goes_on else f"end: {played.end.outcome.value}"
        how = f"it left the counterexample {played.left}" if played.left else f"the mission comes to the same {same}"
        sys.stdout.write("\n".join([title, *(f"  {line}" for line in finding.example), how, f"report: {folder / 'report.html'}"]) + "\n")
    return 1 if played.left else 0


def _refused(why: str) -> int:
    sys.stderr.write(f"{COMMAND}: {why}\n")
    return 2
