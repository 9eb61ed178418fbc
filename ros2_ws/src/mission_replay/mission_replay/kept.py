"""What a replay leaves in its folder, besides its own record: the trace, the verdict, and the report of a mission in virtual time."""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path

from alula_common.faults import FaultRequest
from alula_common.files import write_json, write_text
from mission_replay.recorded import Recorded, ReplayError
from mission_replay.replay import Result
from run_analysis.causes.faults import RunTimes, faults_asked
from uav_missions.plan import write_route
from uav_missions.route import Route


def make_folder(out: Path) -> None:
    """Make the folder of a replay; raises ReplayError where there is something in it."""
    try:
        out.mkdir(parents=True, exist_ok=True)
        if any(out.iterdir()):
            raise ReplayError(f"--out {out}: is not empty; choose another, a replay never overwrites")
    except OSError as error:
        raise ReplayError(f"--out {out}: {error.strerror}") from error


def trace_of(result: Result, zero_s: float) -> list[dict[str, object]]:
    """Return the decisions as they are written; the same replay gives the same, byte for byte."""
    return [{**vars(decision), "t_s": round(decision.t_s - zero_s, 6)} for decision in result.decisions]


def same(recorded: Recorded, result: Result) -> bool:
    """Tell whether all went as it did then."""
    ended_alike = result.end is None or not recorded.outcome or result.end.outcome.value == recorded.outcome
    return result.difference is None and ended_alike


def write_out(out: Path, recorded: Recorded, result: Result, zero_s: float, spoiled: Sequence[FaultRequest]) -> None:
    """Write what is not in the replay's own record: the trace and the verdict; ``spoiled``: faults of measurements."""
    write_text(out / "trace.jsonl", "".join(json.dumps(line) + "\n" for line in trace_of(result, zero_s)))
    route = recorded.mission.get("route")
    if isinstance(route, list):
        write_route(out, Route([(x, y, z) for x, y, z in route]))
    begun_s = min(entry.stamp_s for entry in recorded.entries)
    write_json(out / "mock.json", account_of(result, first_times(spoiled, RunTimes(begun_s, zero_s, result.simulated_s))))
    difference = None if result.difference is None else result.difference.as_dict()
    write_json(
        out / "replay.json", {"of": str(recorded.path), "same": same(recorded, result), "difference": difference, "notes": result.notes}
    )


def first_times(spoiled: Sequence[FaultRequest], times: RunTimes) -> dict[str, float]:
    """Return when each fault of measurements came first, as mocks tell it of theirs: by its name, seconds of mission clock."""
    found: dict[str, float] = {}
    for request, fault in faults_asked(spoiled, times):
        found.setdefault(request.what, fault.at_s)
    return found


def account_of(result: Result, spoiled: Mapping[str, float]) -> dict[str, object]:
    """Return ``mock.json``, as of a flight over mocks; times are mission clock, but for ``wall_s``."""
    faults = [{"sensor": name, "mode": "mock", "t_s": when_s} for name, when_s in {**result.faults, **spoiled}.items()]
    factor = result.simulated_s / result.wall_s if result.wall_s else None
    told = {"simulated_s": result.simulated_s, "wall_s": result.wall_s, "factor": factor, "lift_off_s": result.lift_off_s}
    return {**told, "faults": faults, "notes": list(result.notes)}


def make_report(out: Path, recorded: Recorded, faults: Sequence[str]) -> None:
    """Have summary, timeline and page made of what lies in the folder, by what makes those of flights, in the ROS 1 world.

    Raises:
        ReplayError: it could not be made.
    """
    words = [str(Path(os.environ["ALULA_ROOT"]) / "setup" / "in_ros1"), "python3", "-m", "alula_flight.report", str(out)]
    words += ["--scenario", recorded.scenario, "--of", recorded.path.parent.name, *(word for fault in faults for word in ("--fail", fault))]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    if done.returncode:
        raise ReplayError(f"{out}: no report: {(done.stderr.strip().splitlines() or [f'it ended with {done.returncode}'])[-1]}")
