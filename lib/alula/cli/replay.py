"""``alula replay RUN [--from skills] ...``: make the decisions of a recorded mission again, and tell where they differ.

1. read the command line and the record       3. tell the decisions and the first difference
2. decide again                               4. where the replay is kept, make its report; hold it against expectations

Depths below the skills (the functional layer, the sensors) are an installation's: it gives them to ``main``. Decisions go to standard
output, a line each; the rest to standard error. Ends with 0 (decided as then), 1 (decided otherwise, or an expectation failed), 2 (could
not be replayed).
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from alula.cli.options.runs import SKILLS
from alula.cli.options.runs import replay as options
from alula.cli.parser import Parser
from alula.common.faults import parse_fault
from alula.common.files import json_line, write_text
from alula.common.record import FILE
from alula.records.errors import AnalysisError
from alula.records.expectations import Checked, check, junit, load_expectations
from alula.records.replay.deciding import Conditions, MakeRobot, decide, read_mission
from alula.records.replay.outputs import same, trace_of, verdict, write_out
from alula.records.replay.recorded import Recorded, ReplayError, load
from alula.records.replay.replay import Result
from alula.records.run import load_recorded_run

SAME, OTHERWISE, CANNOT_REPLAY = 0, 1, 2


class Arguments(argparse.Namespace):
    """The command line of ``replay``."""

    run: Path
    depth: str
    tree: str
    model: list[Path]
    settings: list[str]
    fail: list[str]
    behaviour: list[Path]
    names: list[str]
    on: bool
    rate: float
    out: Path | None
    expect: Path | None
    junit: Path | None
    json: bool


@dataclass(frozen=True)
class Below:
    """What answers a mission below its skills, and which failures and settings are then left for the mission itself."""

    make_robot: MakeRobot | None
    fail: Sequence[str]
    settings: Sequence[str]


@dataclass(frozen=True)
class Depth:
    """A depth below the skills.

    Attributes:
        below: makes what answers, of the command line and the record; the folder is for what is not kept. Raises ReplayError.
        alone: replays a bag that belongs to no mission, and tells what came of it; returns the exit code. None: it can't.
    """

    below: Callable[[Arguments, Recorded, Path], Below]
    alone: Callable[[Arguments, Path], int] | None = None


Depths = Mapping[str, Depth]
NO_DEPTHS: Depths = {}


def parse(words: Sequence[str], depths: Depths = NO_DEPTHS) -> Arguments:
    """Return the command line's values; ``depths`` are the robot's own for ``--from``. Wrong ones exit with code 2."""
    parser = Parser(prog="alula replay", description="Make the decisions of a recorded mission again.")
    options(parser, (SKILLS, *depths))
    given: Arguments = parser.parse_args(words, namespace=Arguments())
    if given.junit is not None and given.expect is None:
        parser.error("--junit writes the results of expectations; add --expect FILE")
    if not 0.0 <= given.rate <= 1e6:
        parser.error(f"--rate {given.rate:g}: must be 0 (no limit) or a positive factor")
    return given


def replay(given: Arguments, folder: Path, depths: Depths) -> int:
    """Replay as asked and tell; return the exit code; raises ReplayError. ``folder`` is for what is not kept."""
    depth = depths.get(given.depth)
    if depth is not None and depth.alone is not None and given.run.suffix == ".bag" and not given.run.with_name(FILE).exists():
        return depth.alone(given, folder)
    expectations = None if given.expect is None else load_expectations(given.expect)
    recorded = load(given.run)
    # Expectations are held against a record.
    out = folder / "replay" if given.out is None and expectations is not None else given.out
    result = decide_again(given, recorded, folder, out, depths)
    if out is not None:
        write_out(out, recorded, result, [parse_fault(text) for text in given.fail] if given.depth == "sensors" else ())
    if given.out is not None:
        make_report(given.out, recorded, given.fail)
    tell(recorded, result, as_json=given.json)
    if expectations is None or out is None:
        return SAME if same(recorded, result) else OTHERWISE
    return hold(given, check(expectations, load_recorded_run(out)))


def decide_again(given: Arguments, recorded: Recorded, folder: Path, out: Path | None, depths: Depths) -> Result:
    """Decide at the depth that was asked for; raises ReplayError."""
    mission = read_mission(recorded, tree=given.tree, models=given.model, behaviour=given.behaviour)
    depth = depths.get(given.depth)
    below = Below(None, given.fail, given.settings) if depth is None else depth.below(given, recorded, folder)
    return decide(mission, Conditions(below.make_robot, below.fail, below.settings, go_on=given.on, rate=given.rate, out=out))


def tell(recorded: Recorded, result: Result, *, as_json: bool) -> None:
    """Write the decisions to standard output, and what came of them to standard error."""
    for line, decision in zip(trace_of(result, recorded.zero_s), result.decisions, strict=True):
        sys.stdout.write(json_line(line) if as_json else f"{decision.t_s - recorded.zero_s:9.2f} s  {decision.words()}\n")
    for text in verdict(recorded, result):
        sys.stderr.write(f"{text}\n")


def hold(given: Arguments, checked: Sequence[Checked]) -> int:
    """Tell which expectations were not fulfilled; return the exit code."""
    failed = [one for one in checked if one.problem]
    for one in failed:
        sys.stderr.write(f"{one}\n")
    sys.stderr.write(f"{len(checked) - len(failed)} of {len(checked)} expectations fulfilled\n")
    if given.junit is not None:
        write_text(given.junit, junit(str(given.run), checked))
    return OTHERWISE if failed else SAME


def make_report(out: Path, recorded: Recorded, faults: Sequence[str]) -> None:
    """Make summary, timeline and page of what lies in the folder, as of a run."""
    from alula.report.facts import RunFacts
    from alula.report.making import make_report as make  # late: it draws, which takes a moment

    make(RunFacts(recorded.scenario, None, out, faults, (), None, mock=True, replay_of=recorded.path.parent.name))


def main(words: Sequence[str] | None = None, depths: Depths = NO_DEPTHS) -> int:
    """Replay; return the exit code."""
    given = parse(sys.argv[1:] if words is None else words, depths)
    try:
        with tempfile.TemporaryDirectory() as folder:
            return replay(given, Path(folder), depths)
    except (ReplayError, AnalysisError, OSError) as error:
        sys.stderr.write(f"alula replay: {error}\n")
        return CANNOT_REPLAY


if __name__ == "__main__":
    sys.exit(main())
