"""``summary.json``: one run in numbers. Times are seconds since the departure, rounded to the millisecond; null is "not known".

``causes``, which is what the page shows of failures (``page/causes.py``), alone has stamps of mission clock.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any, TypedDict

from alula.common.faults import parse_fault
from alula.common.operator import PAUSE, is_operator
from alula.common.robots import page_words, robots_of_fleet
from alula.common.run_log import ACT, read
from alula.common.scenarios import load_scenario
from alula.report.aborts import read_abort, true_reason, with_dead
from alula.report.facts import Death, RunFacts
from alula.report.files import Problems, ReportError, finite, mapping, read_json, sequence
from alula.report.history import History
from alula.report.mock_account import MockSummary
from alula.report.observed import Observed
from alula.report.part import Findings
from alula.report.phases import Phases, home, status_changes
from alula.report.recovery import Recovery
from alula.report.responses import FaultResponse, injected, summarise_response
from alula.report.rows import resources, skills

OUTCOMES = frozenset({"accomplished", "degraded", "given_up", "aborted", "not_started", "served", "running"})


class RecoverySummary(TypedDict):
    """Times of the recovery, seconds since lift-off; None: it did not happen."""

    failure_s: float | None
    detected_s: float | None
    fallback_running_s: float | None
    moving_again_s: float | None


class InjectedFault(TypedDict):
    """A sensor that the simulator broke."""

    sensor: str
    mode: str
    t_s: float | None


class LiftOff(TypedDict):
    """The origin of all times: its absolute stamp of mission clock, and what it was read from."""

    stamp_s: float
    source: str


Summary = dict[str, Any]
"""The whole file: what every run has (``summarise``), and what the robot's part of the report adds."""


TOLD_ABOVE = ("scenario", "outcome", "reason", "problems", "start_s", "lift_off_s", "end_s", "joined")
"""What of the mission's account has a place of its own in the summary, and its stamps, which don't count from the departure."""


def read_outcome(facts: RunFacts, history: History, problems: Problems) -> tuple[str | None, str | None]:
    """Return the mission's outcome and its reason, by its own account; of one that a signal ended, who had it sent and why."""
    values = history.mission
    outcome, reason = (str(values[name]) if values.get(name) is not None else None for name in ("outcome", "reason"))
    for problem in sequence(values.get("problems")):
        problems.note(str(problem))
    if outcome not in OUTCOMES:
        problems.note(f"the mission's account is missing: no outcome{f' that is known: {outcome}' if outcome else ''}")
        outcome = None
    if outcome == "running":
        problems.note(
            "the replay stopped before the mission's end" if facts.replay_of else "the mission's process ended before the mission did"
        )
    if outcome != "aborted":
        return outcome, reason or None
    return outcome, with_dead(true_reason(reason or None, read_abort(facts.out_dir)), facts.died)


def read_bridge(facts: RunFacts, problems: Problems) -> dict[str, object] | None:
    """Return the bridge's statistics, topic by topic; None where the run had no bridge, as over mocks, and a fleet's mission by itself."""
    if facts.mock or robots_of_fleet():
        return None
    statistics: object = None
    with problems.survive("bridge.json"):
        statistics = mapping(read_json(facts.out_dir / "logs/bridge.json")).get("topics")
        if not isinstance(statistics, dict):
            raise ReportError("bridge.json holds no statistics of topics")
    return mapping(statistics) or None


def came_back(history: History, observed: Observed, phases: Phases) -> bool | None:
    """Return whether the robot's last state is that of departure; None: it never departed, or the state is not known."""
    place = home()
    if not phases.departed or place is None:
        return None
    said = [] if observed.is_back is None else [observed.is_back]
    said += [change.to_state == place[1] for change in status_changes(history)[-1:]]
    return any(said) if said else None


def duration_s(history: History, observed: Observed, phases: Phases) -> float | None:
    """Return seconds from the departure until the robot was back, or to the last thing that was recorded if it never was.

    Of a robot without a state of departure: from the mission's start to its end, by its own account.
    """
    if not phases.departed:
        start_s, end_s = (finite(history.mission.get(name)) for name in ("start_s", "end_s"))
        return None if home() is not None or start_s is None or end_s is None else round(end_s - start_s, 3)
    ends = [history.last_s, observed.last_s]
    end_s = phases.back_s or max((end for end in ends if end is not None), default=None)
    return phases.since(end_s)


def note_doubts(facts: RunFacts, history: History, observed: Observed, phases: Phases, problems: Problems) -> None:
    """Return sentences about what the numbers hide: no departure, faults that never happened."""
    scenario = load_scenario(facts.scenario)
    if not phases.departed and home() is not None and scenario.mission:  # who only serves skills may stay where it is
        problems.note(f"no {page_words()['departure']} is known: times count from {phases.zero_from}")
    broken = {fault.sensor for fault in injected(observed)}
    # What scenarios add is in no bag, as the radio's; mocks tell all.
    untold = set() if facts.mock else dict(scenario.faults).keys() - dict(scenario.processes).keys()
    acts = {act.get("command") for act in read(facts.out_dir, ACT)}
    ends = [end_s for end_s in (history.last_s, observed.last_s) if end_s is not None]
    for text in facts.faults:
        fault = parse_fault(text)
        if fault.begin_s is not None and phases.departed and ends and (over_s := max(ends) - phases.zero_s) < fault.begin_s:
            problems.note(f"the fault {text} never happened: the run was over {over_s:.1f} s after the {page_words()['departure']}")
        elif is_operator(fault) and (fault.how or PAUSE) in acts:
            continue
        elif observed.tells_faults and fault.what not in untold | broken:
            problems.note(f"the fault {text} never happened")


def summarise(
    facts: RunFacts,
    *,
    history: History,
    observed: Observed,
    phases: Phases,
    responses: Sequence[FaultResponse],
    recovery: Recovery | None,
    findings: Findings,
    problems: Problems,
    mock: MockSummary | None = None,
) -> Summary:
    """Return ``summary.json`` of a run; what could not be read becomes a sentence among the problems."""
    outcome, reason = read_outcome(facts, history, problems)
    bridge = read_bridge(facts, problems)
    note_doubts(facts, history, observed, phases, problems)
    return {
        "scenario": facts.scenario,
        "outcome": outcome,
        "reason": reason,
        "mission": {name: value for name, value in history.mission.items() if name not in TOLD_ABOVE} or None,
        "landed": came_back(history, observed, phases) if findings.landed is None else findings.landed,
        "seed": facts.seed,
        "duration_s": duration_s(history, observed, phases),
        "skills": skills(history, phases),
        "resources": resources(history, phases),
        "recovery": _recovery(recovery, phases),
        "bridge": bridge,
        "faults": list(facts.faults),
        "injected": [InjectedFault(sensor=f.sensor, mode=f.mode, t_s=phases.since(f.t_s)) for f in injected(observed)],
        "answers": [summarise_response(one, phases) for one in responses],
        "died": [Death({**one, "when_s": phases.since(one["when_s"]), "again_s": phases.since(one["again_s"])}) for one in facts.died],
        "mission_exit": facts.mission_exit,
        "conformance": None if facts.conformance is None else dict(facts.conformance),
        "mock": mock,
        "lift_off": LiftOff(stamp_s=phases.zero_s, source=phases.zero_from),
        "tasks": [asdict(task) for task in findings.tasks],
        **findings.values,
        "problems": problems.sentences,
    }


def _recovery(recovery: Recovery | None, phases: Phases) -> RecoverySummary | None:
    if recovery is None:
        return None
    return RecoverySummary(
        failure_s=phases.since(recovery.failure_s),
        detected_s=phases.since(recovery.detected_s),
        fallback_running_s=phases.since(recovery.fallback_running_s),
        moving_again_s=phases.since(recovery.moving_again_s),
    )
