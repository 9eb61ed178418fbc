"""A live run of a campaign as a process: started by the command line, as a user does, and ended with the campaign."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Collection, Sequence
from pathlib import Path

from alula.campaign.plan import PlannedRun
from alula.common.processes import die_with_parent, end_run
from alula.runtime.live.options import entry
from alula.runtime.live.spec import FILE

MOST_TRIES = 1000


def run_live(planned: PlannedRun, options: Sequence[str], out: Path) -> tuple[Path, subprocess.CompletedProcess[str]]:
    """Run to the end; return the run's folder, below the campaign's folder ``out``, and the completed command with its output.

    A worker that dies takes the run with it: the kernel signals the run, which brings the robot to rest and ends.
    """
    folder = out / _name(planned)
    for number in range(2, MOST_TRIES):  # one that a crash has left half done stays as it is
        if not folder.exists():
            break
        folder = out / f"{_name(planned)}-{number}"
    done = subprocess.run(
        [*words_of_run(planned), *options, "--out", str(folder)],
        capture_output=True,
        text=True,
        check=False,
        stdin=subprocess.DEVNULL,
        preexec_fn=die_with_parent,
    )
    return folder, done


def words_of_run(planned: PlannedRun) -> list[str]:
    """Return the command line that repeats a run alone, without the robot's own options."""
    words = [entry(), "run", planned.scenario, "--seed", str(planned.seed)]
    if planned.world is not None:
        words += ["--world", str(planned.world.absolute())]
    for fault in planned.faults:
        words += ["--fail", fault]
    return words


def end_live(runs: Collection[PlannedRun], out: Path) -> None:
    """End the processes of runs that are under way on this machine: a campaign that is interrupted leaves none."""
    for planned in runs:
        for folder in out.glob(f"{_name(planned)}*"):
            try:
                run_id = str(json.loads((folder / FILE).read_text(encoding="utf-8"))["run_id"])
            except (OSError, ValueError, KeyError):
                continue
            end_run(run_id, timeout_s=0.0)


def _name(planned: PlannedRun) -> str:
    return f"run-{planned.number:05d}"
