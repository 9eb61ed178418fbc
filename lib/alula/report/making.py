"""The report's main flow: from what a run left in its folder to numbers, pictures and a page.

1. the history of the skillsets, and what the robot's own recordings tell       4. the timeline
2. when it departed, and when it was back                                        5. what the robot's part measures and draws
3. what failed, and what the mission did about it                                6. the summary, the page, and what it explains
"""

from __future__ import annotations

from dataclasses import dataclass

from alula.common.files import write_aside, write_json
from alula.common.record import FILE as RECORD
from alula.common.robots import meaning
from alula.common.runs import robot_of
from alula.common.scenarios import load_scenario
from alula.records.causes.alarms import Alarms
from alula.records.causes.effects import EffectsByFault
from alula.records.causes.fault_file import effects_of_models, effects_of_robot
from alula.report.facts import RunFacts
from alula.report.files import Problems
from alula.report.history import History, read_history
from alula.report.mock_account import MockSummary, read_mock
from alula.report.observed import Observed
from alula.report.page.entries import FAULT, Wire
from alula.report.page.writing import write_report
from alula.report.part import Findings, ReportedRun, ReportPart, part_of_robot
from alula.report.phases import Phases, find_phases
from alula.report.recovery import Recovery, find_recovery
from alula.report.responses import FaultResponse, Known, find_responses, known_faults
from alula.report.summary import Summary, summarise
from alula.report.timeline import Timeline, make_timeline
from alula.report.timeline_picture import draw_timeline


@dataclass(frozen=True)
class Account:
    """What happened in the skillsets, and the results derived from it."""

    observed: Observed
    mock: MockSummary | None
    phases: Phases
    responses: tuple[FaultResponse, ...]
    recovery: Recovery | None
    alarms: Alarms


def make_report(facts: RunFacts) -> Summary:
    """Make ``timeline.json``, ``timeline.svg``, ``summary.json`` and ``report.html`` in the run's folder; return the summary.

    The robot's part adds files and numbers of its own. Whatever is missing, cut off, makes no sense or can't be written is named in the
    summary's ``problems``; numbers that depend on it are None.
    """
    with meaning(robot_of(facts.out_dir)):
        return _made(facts)


def _made(facts: RunFacts) -> Summary:
    run = _begin(facts)
    part = part_of_robot(run)
    account = _account(run, part)
    timeline = _timeline(run, account)
    findings = Findings()
    with run.problems.survive("the robot's part of the report"):
        findings = part.measure(account.phases, account.recovery, timeline)
    # The numbers come behind the pictures, because they tell what went wrong with the rest.
    summary = summarise(
        facts,
        history=run.history,
        observed=account.observed,
        phases=account.phases,
        responses=account.responses,
        recovery=account.recovery,
        findings=findings,
        mock=account.mock,
        problems=run.problems,
    )
    _write_page(run, part, account, summary)
    _write_summary(run, summary)
    return summary


def _begin(facts: RunFacts) -> ReportedRun:
    problems, history = Problems(), History()
    with problems.survive(RECORD):
        history = read_history(facts.out_dir / RECORD, problems)
    return ReportedRun(facts, load_scenario(facts.scenario), history, problems)


def _account(run: ReportedRun, part: ReportPart) -> Account:
    observed, mock = Observed(), None
    if run.facts.mock:
        observed, mock = read_mock(run.folder, run.problems)
    else:
        with run.problems.survive("the robot's recordings"):
            observed = part.observe(run)
    phases = find_phases(run.history, observed)
    effects = EffectsByFault()
    with run.problems.survive("what faults can bring about"):
        effects = effects_of_models()
        effects = effects_of_robot()
    known: list[Known] = known_faults(run.facts, run.scenario, run.history, observed, phases, effects)
    with run.problems.survive("what else failed"):
        known += part.failures(phases, [fault for _, fault in known], effects)
    responses = find_responses(known, run.history)
    recovery = find_recovery(run.scenario, run.history, observed, phases, responses, effects.alarms)
    return Account(observed, mock, phases, responses, recovery, effects.alarms)


def _timeline(run: ReportedRun, account: Account) -> Timeline | None:
    timeline: Timeline | None = None
    with run.problems.survive("timeline"):
        timeline = made = make_timeline(run.history, account.phases, account.recovery, account.alarms)
        write_json(run.folder / "timeline.json", made)
        write_aside(run.folder / "timeline.svg", lambda aside: draw_timeline(made, aside, title=run.title))
    return timeline


def _write_page(run: ReportedRun, part: ReportPart, account: Account, summary: Summary) -> None:
    """Write the page, of the summary and all that is in the folder by now, and take what it explains into the summary."""
    problems = Problems()
    with problems.survive("report.html"):
        entries = [*fault_entries(account.observed), *part.entries()]
        summary["causes"] = write_report(run.folder, entries, title=run.title, summary=summary)
    summary["problems"] = [*summary["problems"], *problems.sentences]


def fault_entries(observed: Observed) -> list[Wire]:
    """Return the entries of the page about faults that began and ended."""
    return [(FAULT, round(fault.t_s, 3), {"sensor": fault.sensor, "mode": fault.mode}) for fault in observed.all_faults]


def _write_summary(run: ReportedRun, summary: Summary) -> None:
    try:
        write_json(run.folder / "summary.json", summary)
    except OSError as error:
        summary["problems"] = [*summary["problems"], f"summary.json could not be written: {error.strerror or error}"]
