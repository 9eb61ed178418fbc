"""``./alula replay RUN [--from skills] ...``: make the decisions of a recorded mission again, and tell where they differ.

Decisions go to standard output, a line each; the rest to standard error. Ends with 0 (decided as then), 1 (decided otherwise, or an
expectation failed), 2 (could not be replayed).
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from collections.abc import Iterable, Sequence
from pathlib import Path

from alula_common.faults import parse_fault
from alula_common.files import write_text
from alula_common.record import FILE, Entry
from mission_replay.again import bag_of, is_perception, perceive
from mission_replay.asked import behaviour_for, faults_for, parameters_for, plan_for, skillsets_for
from mission_replay.kept import make_folder, make_report, same, trace_of, write_out
from mission_replay.recorded import Recorded, ReplayError, load
from mission_replay.replay import Replay, Result
from mission_replay.vehicle import RecordedSkills, Vehicle
from run_analysis.errors import AnalysisError
from run_analysis.expectations import Checked, check, junit, load_expectations
from run_analysis.run import load_run
from skill_missions.record import MissionRecord
from skill_model.model import Skillset
from skill_runtime.mock import Behaviour

SAME, OTHERWISE, CANNOT_REPLAY = 0, 1, 2


def parse(words: Sequence[str]) -> argparse.Namespace:
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
    options = parser.parse_args(words)
    if options.junit is not None and options.expect is None:
        parser.error("--junit tells of expectations; add --expect FILE")
    if not 0.0 <= options.rate <= 1e6:
        parser.error(f"--rate {options.rate:g}: must be 0 (no limit) or a positive factor")
    return options


def prepare(recorded: Recorded, options: argparse.Namespace) -> Replay:
    """Make the replay; raises ReplayError."""
    plan = plan_for(recorded, options.tree)
    skillsets = skillsets_for(plan, options.model)
    behaviour = behaviour_for(recorded, skillsets, options.behaviour)
    if options.depth == "sensors":  # what fails and is set there is the perception's business
        perception = [text for text in options.settings if is_perception(text)]
        options.run = perceive(bag_of(recorded, options.run), options.folder, options.fail, perception, options.names)
        options.settings, options.fail = [text for text in options.settings if text not in perception], []
    parameters = parameters_for(recorded, plan, options.settings)
    faults = faults_for(behaviour, options.fail)
    vehicle, entries = vehicle_at(options, recorded, skillsets, behaviour)
    for fault in faults:
        vehicle.fail(fault)
    make_record = None
    if options.out is not None:
        make_folder(options.out)
        make_record = lambda clock_ns: MissionRecord(options.out, plan, clock_ns, parameters)  # noqa: E731
    return Replay(recorded, vehicle, entries, plan, parameters=parameters, go_on=options.on, record=make_record, rate=options.rate)


def vehicle_at(
    options: argparse.Namespace, recorded: Recorded, skillsets: list[Skillset], behaviour: Behaviour
) -> tuple[Vehicle, Iterable[Entry]]:
    """Return what answers the tree, and what is told it, at the depth that is asked for; raises ReplayError."""
    if options.depth == "skills":
        start_s = min(entry.stamp_s for entry in recorded.entries)
        return RecordedSkills(skillsets, recorded, behaviour, start_s=start_s), recorded.entries
    # Late: it needs the interfaces, which a replay of skills does without.
    from mission_replay.functional import RecordedFunctions
    from mission_replay.functional_bag import begin_of, entries_of

    bag = bag_of(recorded, options.run)
    functions = RecordedFunctions(skillsets, bag, behaviour, start_s=begin_of(recorded, bag))
    return functions, entries_of(recorded, bag, functions.topics)


def zero_of(recorded: Recorded) -> float:
    """Return what times count from: lift-off, or the record's beginning where there was none."""
    lift_off_s = recorded.mission.get("lift_off_s")
    return float(lift_off_s) if isinstance(lift_off_s, int | float) else min(entry.stamp_s for entry in recorded.entries)


def verdict(recorded: Recorded, result: Result, zero_s: float) -> list[str]:
    """Return what came of it, in lines."""
    lines = []
    if not recorded.whole:
        lines.append(f"the record breaks off after {len(recorded.decisions)} decisions; replayed up to there")
    if result.difference is not None:
        lines += result.difference.lines(zero_s)
        now = "stopped there" if result.end is None else result.end.outcome.value
        return [*lines, f"outcome then: {recorded.outcome or 'unknown'}, now: {now}"]
    lines.append(f"{len(result.decisions)} decisions, all as they were")
    if result.end is not None:
        lines.append(f"outcome: {result.end.outcome.value}{f': {result.end.reason}' if result.end.reason else ''}")
    return lines


def replay(options: argparse.Namespace) -> int:
    """Replay as asked and tell; return the exit code; raises ReplayError."""
    if options.depth == "sensors" and options.run.suffix == ".bag" and not options.run.with_name(FILE).exists():
        return perception_alone(options)
    expectations = None if options.expect is None else load_expectations(options.expect)
    recorded = load(options.run)
    result = prepare(recorded, options).run()
    zero_s = zero_of(recorded)
    if options.out is not None:
        spoiled = [parse_fault(text) for text in options.failed] if options.depth == "sensors" else []
        write_out(options.out, recorded, result, zero_s, spoiled)
    if options.kept:
        make_report(options.out, recorded, options.failed)
    for line, decision in zip(trace_of(result, zero_s), result.decisions, strict=True):
        text = json.dumps(line) if options.json else f"{decision.t_s - zero_s:9.2f} s  {decision.words()}"
        sys.stdout.write(f"{text}\n")
    for text in verdict(recorded, result, zero_s):
        sys.stderr.write(f"{text}\n")
    if expectations is None:
        return SAME if same(recorded, result) else OTHERWISE
    return hold(options, check(expectations, load_run(options.out)))


def perception_alone(options: argparse.Namespace) -> int:
    """Tell what the perception says of a bag that belongs to no mission: the transitions that it asks for; return the exit code."""
    from mission_replay.functional_bag import read_calls

    if not options.run.is_file():
        raise ReplayError(f"{options.run}: there is no such bag")
    calls = read_calls(perceive(options.run, options.folder, options.fail, options.settings, options.names))
    for call in calls:
        skillset = call.service.split("/")[1]
        text = f"{call.end_s:9.2f} s  {skillset}.{call.request.get('resource')} -> {call.request.get('to')}"
        sys.stdout.write(f"{json.dumps(vars(call)) if options.json else text}\n")
    sys.stderr.write("no record of a mission lies beside it: perceived only\n")
    return SAME


def hold(options: argparse.Namespace, checked: Sequence[Checked]) -> int:
    """Tell which expectations were not fulfilled; return the exit code."""
    failed = [one for one in checked if one.problem]
    for one in failed:
        sys.stderr.write(f"{one}\n")
    sys.stderr.write(f"{len(checked) - len(failed)} of {len(checked)} expectations fulfilled\n")
    if options.junit is not None:
        write_text(options.junit, junit(str(options.run), checked))
    return OTHERWISE if failed else SAME


def main(words: Sequence[str] | None = None) -> int:
    """Replay; return the exit code."""
    options = parse(sys.argv[1:] if words is None else words)
    try:
        with tempfile.TemporaryDirectory() as folder:
            options.folder, options.kept, options.failed = Path(folder), options.out is not None, tuple(options.fail)
            if options.expect is not None and options.out is None:  # expectations are held against a record
                options.out = options.folder / "replay"
            return replay(options)
    except (ReplayError, AnalysisError, OSError) as error:
        sys.stderr.write(f"alula replay: {error}\n")
        return CANNOT_REPLAY


if __name__ == "__main__":
    sys.exit(main())
