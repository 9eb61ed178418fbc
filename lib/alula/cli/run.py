"""``alula run SCENARIO --mock``: run a mission over mocks, in virtual time, and make its report. It needs no ROS and nothing generated.

1. read the command line       3. write what failed when, and how fast it was
2. run the mission             4. make the report, and say how it went

Ends with 0 (accomplished, also when degraded), 1 (given up or aborted), 2 (could not start; then nothing is written). The first Ctrl-C
has the robot come to rest, the second ends everything at once.
"""

from __future__ import annotations

import argparse
import os
import signal
import sys
from collections.abc import Sequence
from pathlib import Path

from alula.api.mission import Mission, note_account
from alula.cli.options.runs import every_run
from alula.cli.parser import Parser
from alula.cli.run_request import check_limit, check_seed, groot_address, run_folder, shown_at
from alula.common.faults import FaultError, parse_fault
from alula.common.robots import RobotError
from alula.common.scenarios import ScenarioError
from alula.common.signals import Interrupts
from alula.missions.director import EXIT_CODES, Outcome
from alula.missions.mocked import MockedMission
from alula.missions.plan import InputError
from alula.records.conformance import Monitor
from alula.records.errors import AnalysisError
from alula.records.models import models_of
from alula.report.aborts import aborted_by_signal, note_abort
from alula.report.facts import RunFacts
from alula.report.live import LiveEvents
from alula.report.making import make_report
from alula.report.verdict import verdict_lines
from alula.runtime.live.spec import FILE, RequestError, RunSpec
from alula.trees.groot.address import ServerError

CANNOT_START = EXIT_CODES[Outcome.NOT_STARTED]


def parse(words: Sequence[str]) -> argparse.Namespace:
    """Read the command line; raises RequestError."""
    parser = Parser(prog="alula run", description="Run a scenario of the robot over mocks, in virtual time.")
    every_run(parser)
    given, others = parser.parse_known_args(words)
    if not given.mock:
        raise RequestError("without --mock a run needs an installation with ROS: use ./alula of a checkout")
    if others:
        raise RequestError(f"{others[0]}: a run over mocks has no such option; leave it out, or --mock")
    return given


def prepare(given: argparse.Namespace) -> tuple[MockedMission, RunSpec]:
    """Read what the run needs, and make its folder; return the mission, and what the run is.

    Raises:
        AnalysisError, FaultError, RequestError, RobotError, ScenarioError, InputError: it can't be run; nothing was written.
    """
    out, seed, limit_s = run_folder(given.out, given.scenario), check_seed(given.seed), check_limit(given.limit)
    mission = Mission.load(given.scenario, world=given.world, behaviour=given.behaviour)
    groot = groot_address(given.groot)
    mocked = mission.mocked(*given.fail, seed=seed, out=out, groot=groot, monitor=given.monitor, limit_s=limit_s)
    return mocked, RunSpec.load(out / FILE)


def run(given: argparse.Namespace) -> int:
    """Run and report; return the exit code. Raises what `prepare` does."""
    mission, spec = prepare(given)
    out = Path(spec.out_dir)
    _say(f"running '{spec.scenario}' over mocks, seed {spec.seed}{''.join(f', failing {one}' for one in spec.faults)}; results in {out}")
    if spec.groot:
        _say(shown_at(spec.groot))
    _abort_on_signals(mission, out)
    end = mission.run()
    monitor = Monitor(models_of(dict.fromkeys(event.skillset for event in mission.events))) if given.monitor else None
    LiveEvents(out, _say, monitor).show_new()
    note_account(out, mission, [parse_fault(text) for text in spec.faults])
    code = EXIT_CODES[end.outcome]
    conformance = None if monitor is None else monitor.verdict.as_dict()
    summary = make_report(RunFacts(spec.scenario, spec.seed, out, spec.faults, (), code, mock=True, conformance=conformance))
    sys.stdout.write("\n".join(verdict_lines(summary, (), out)) + "\n")
    return code


def _abort_on_signals(mission: MockedMission, out: Path) -> None:
    def first() -> None:
        note_abort(out, aborted_by_signal(interrupts.first))
        mission.abort(f"told to end by {interrupts.first.name if interrupts.first else 'a signal'}")

    def second() -> None:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        os.kill(os.getpid(), signal.SIGTERM)

    interrupts = Interrupts(first, second)
    interrupts.install()


def _say(line: str) -> None:
    sys.stderr.write(f"{line}\n")


def main(words: Sequence[str] | None = None) -> int:
    """Run; return the exit code."""
    try:
        return run(parse(sys.argv[1:] if words is None else words))
    except (AnalysisError, FaultError, RequestError, RobotError, ScenarioError, InputError, ServerError, OSError) as error:
        sys.stderr.write(f"alula run: {error}\n")
        return CANNOT_START


if __name__ == "__main__":
    sys.exit(main())
