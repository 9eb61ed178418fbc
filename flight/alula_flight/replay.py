"""``./alula replay RUN [--from skills] ...``: make the decisions of a recorded mission again, and tell where they differ.

1. read the command line and the record       4. tell the decisions and the first difference
2. from sensors: perceive again               5. where the replay is kept: make its report
3. decide again                               6. hold it against expectations

It runs in the ROS 2 world, where missions decide; perceiving and reporting are processes of the ROS 1 world. Decisions go to standard
output, a line each; the rest to standard error. Ends with 0 (decided as then), 1 (decided otherwise, or an expectation failed), 2 (could
not be replayed).
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from sensor_replay.nodes import is_setting

from alula.common.faults import parse_fault
from alula.common.files import write_text
from alula.common.record import FILE
from alula.records.errors import AnalysisError
from alula.records.expectations import Checked, check, junit, load_expectations
from alula.records.replay.deciding import BAG, Conditions, bag_of, decide, read_mission
from alula.records.replay.kept import same, trace_of, verdict, write_out
from alula.records.replay.recorded import Recorded, ReplayError, load
from alula.records.replay.replay import Result
from alula.records.run import load_run
from skillset_ros2.replay import from_bag

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


def parse(words: Sequence[str]) -> Arguments:
    """Read the command line."""
    parser = argparse.ArgumentParser(prog="alula replay", description="Make the decisions of a recorded mission again.")
    parser.add_argument("run", type=Path, metavar="RUN", help="a run's folder, its skills.mcap or its functional.bag")
    parser.add_argument(
        "--from", dest="depth", choices=["sensors", "functional", "skills"], default="skills", help="what is taken from the record"
    )
    parser.add_argument("--tree", default="", metavar="FILE.py|MODULE[:FUNCTION]", help="another tree: function plan(route) -> MissionPlan")
    parser.add_argument("--model", type=Path, action="append", default=[], metavar="FILE", help="another model of a skillset")
    parser.add_argument(
        "--set", action="append", default=[], dest="settings", metavar="NAME=VALUE", help="another parameter of the mission"
    )
    parser.add_argument("--fail", action="append", default=[], metavar="WHAT[@SECONDS[-SECONDS]]", help="what did not fail then")
    parser.add_argument(
        "--behaviour", type=Path, action="append", default=[], metavar="FILE", help="what mocks do where nothing was recorded"
    )
    parser.add_argument(
        "--map", action="append", default=[], dest="names", metavar="/THEIRS:=/OURS", help="a topic of the bag, from sensors"
    )
    parser.add_argument("--on", action="store_true", help="go on over mocks after the first difference")
    parser.add_argument("--rate", type=float, default=0.0, help="mission clock a second at most (default 0: no limit)")
    parser.add_argument("--out", type=Path, help="folder for the replay's own record, summary, pictures and report")
    parser.add_argument("--expect", type=Path, metavar="FILE", help="hold the replay against expectations; they decide how it ends")
    parser.add_argument("--junit", type=Path, metavar="FILE", help="with --expect: write the results as JUnit XML, too")
    parser.add_argument("--json", action="store_true", help="decisions and difference as JSON, a line each")
    given = parser.parse_args(words, namespace=Arguments())
    if given.junit is not None and given.expect is None:
        parser.error("--junit tells of expectations; add --expect FILE")
    if not 0.0 <= given.rate <= 1e6:
        parser.error(f"--rate {given.rate:g}: must be 0 (no limit) or a positive factor")
    return given


def replay(given: Arguments, folder: Path) -> int:
    """Replay as asked and tell; return the exit code; raises ReplayError. ``folder`` is for what is not kept."""
    if given.depth == "sensors" and given.run.suffix == ".bag" and not given.run.with_name(FILE).exists():
        return perception_alone(given, folder)
    expectations = None if given.expect is None else load_expectations(given.expect)
    recorded = load(given.run)
    # Expectations are held against a record.
    out = folder / "replay" if given.out is None and expectations is not None else given.out
    result = decide_again(given, recorded, folder, out)
    if out is not None:
        write_out(out, recorded, result, [parse_fault(text) for text in given.fail] if given.depth == "sensors" else ())
    if given.out is not None:
        make_report(given.out, recorded, given.fail)
    tell(recorded, result, as_json=given.json)
    if expectations is None or out is None:
        return SAME if same(recorded, result) else OTHERWISE
    return hold(given, check(expectations, load_run(out)))


def decide_again(given: Arguments, recorded: Recorded, folder: Path, out: Path | None) -> Result:
    """Decide at the depth that was asked for, from sensors after perceiving again; raises ReplayError."""
    mission = read_mission(recorded, tree=given.tree, models=given.model, behaviour=given.behaviour)
    bag, settings, fail = None, given.settings, given.fail
    if given.depth != "skills":
        bag = bag_of(recorded, given.run)
    if given.depth == "sensors" and bag is not None:  # what fails and is set there is the perception's business
        bag = perceive(bag, folder, given.fail, [text for text in settings if is_setting(text)], given.names)
        settings, fail = [text for text in settings if not is_setting(text)], []
    answers = None if bag is None else from_bag(bag)
    return decide(mission, Conditions(answers, fail, settings, go_on=given.on, rate=given.rate, out=out))


def tell(recorded: Recorded, result: Result, *, as_json: bool) -> None:
    """Write the decisions to standard output, and what came of them to standard error."""
    for line, decision in zip(trace_of(result, recorded.zero_s), result.decisions, strict=True):
        text = json.dumps(line) if as_json else f"{decision.t_s - recorded.zero_s:9.2f} s  {decision.words()}"
        sys.stdout.write(f"{text}\n")
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


def perception_alone(given: Arguments, folder: Path) -> int:
    """Tell what the perception says of a bag that belongs to no mission: the transitions that it asks for; return the exit code."""
    from skillset_ros2.replay.bag import read_calls  # late: it needs a reader of bags

    if not given.run.is_file():
        raise ReplayError(f"{given.run}: there is no such bag")
    for call in read_calls(perceive(given.run, folder, given.fail, given.settings, given.names)):
        skillset = call.service.split("/")[1]
        text = f"{call.end_s:9.2f} s  {skillset}.{call.request.get('resource')} -> {call.request.get('to')}"
        sys.stdout.write(f"{json.dumps(vars(call)) if given.json else text}\n")
    sys.stderr.write("no record of a mission lies beside it: perceived only\n")
    return SAME


# --- processes of the ROS 1 world ---------------------------------------------------------------------------------------


def perceive(bag: Path, folder: Path, faults: Sequence[str], settings: Sequence[str], names: Sequence[str]) -> Path:
    """Return a bag like this one, with what the perception says of its measurements now; it lies in ``folder``.

    ``names``: what topics of the bag are called here, as ``/theirs:=/ours``.

    Raises:
        ReplayError: the bag holds no measurements, or a failure or a setting does not exist.
    """
    again = folder / BAG
    words = [*each("--fail", faults), *each("--set", settings), *each("--map", names)]
    said, code = in_ros1("sensor_replay", str(bag), str(again), *words)
    if code:
        raise ReplayError(said or f"perceiving ended with {code}")
    return again


def make_report(out: Path, recorded: Recorded, faults: Sequence[str]) -> None:
    """Make summary, timeline and page of what lies in the folder, as of a flight; raises ReplayError where they could not be made."""
    of_run = ["--scenario", recorded.scenario, "--of", recorded.path.parent.name]
    said, code = in_ros1("alula.report", str(out), *of_run, *each("--fail", faults))
    if code:
        raise ReplayError(f"{out}: no report: {said or f'it ended with {code}'}")


def each(option: str, values: Sequence[str]) -> list[str]:
    """Return an option of a command line for each value."""
    return [word for value in values for word in (option, value)]


def in_ros1(module: str, *words: str) -> tuple[str, int]:
    """Run a module in the ROS 1 world; return the last line of its standard error, and its exit code."""
    command = [str(Path(os.environ["ALULA_ROOT"]) / "setup" / "in_ros1"), "python3", "-m", module, *words]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return (done.stderr.strip().splitlines() or [""])[-1], done.returncode


def main(words: Sequence[str] | None = None) -> int:
    """Replay; return the exit code."""
    given = parse(sys.argv[1:] if words is None else words)
    try:
        with tempfile.TemporaryDirectory() as folder:
            return replay(given, Path(folder))
    except (ReplayError, AnalysisError, OSError) as error:
        sys.stderr.write(f"alula replay: {error}\n")
        return CANNOT_REPLAY


if __name__ == "__main__":
    sys.exit(main())
