"""``summary.json``: one flight in numbers. Times are seconds since lift-off, rounded to the millisecond; null is "not known"."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypedDict

from alula.common.faults import parse_fault
from alula.common.scenarios import load_scenario
from alula_flight.report.answers import AnswerSummary, FaultAnswer, injected, summarise_answer
from alula_flight.report.events import History
from alula_flight.report.facts import Death, RunFacts
from alula_flight.report.files import Problems, ReportError, mapping, read_json, sequence
from alula_flight.report.map_quality import MapQuality
from alula_flight.report.mocked import MockSummary
from alula_flight.report.phases import Phases, flight_status
from alula_flight.report.recording import ON_GROUND, Recording
from alula_flight.report.recovery import Recovery
from alula_flight.report.truth import Encounter, worse
from alula_flight.report.video import VideoSummary

OUTCOMES = frozenset({"accomplished", "degraded", "given_up", "aborted", "not_started", "running"})


class MapSummary(TypedDict):
    """See `map_quality`."""

    points: int | None
    coverage: float | None
    rmse_m: float | None
    patches_in_reach: int | None


class SkillSummary(TypedDict):
    """One execution; ``outcome`` RUNNING or REQUESTED: its end was never seen. ``result_kind`` is as in the record of an event."""

    skillset: str
    skill: str
    id: str
    inputs: dict[str, object]
    start_s: float | None
    running_s: float | None
    end_s: float | None
    outcome: str
    result: str
    result_kind: str
    message: str


ResourceSummary = TypedDict(
    "ResourceSummary",
    {"t_s": float | None, "skillset": str, "resource": str, "from": str, "to": str, "cause": str},
)


class RecoverySummary(TypedDict):
    """See `recovery`."""

    failure_s: float | None
    detected_s: float | None
    fallback_running_s: float | None
    moving_again_s: float | None


class InjectedFault(TypedDict):
    """A sensor that the simulator broke."""

    sensor: str
    mode: str
    t_s: float | None


class EncounterSummary(TypedDict):
    """One account of how near the vehicle came."""

    collisions: int | None
    crash: str | None
    min_clearance_m: float | None
    distance_m: float | None


class LiftOff(TypedDict):
    """The origin of all times: its absolute stamp of mission clock, and what it was read from."""

    stamp_s: float
    source: str


class Summary(TypedDict):
    """The whole file. ``collisions``, ``min_clearance_m``, ``distance_m``: the worse of ``accounts``. ``mock``: None in the simulator.

    ``crash``: how the vehicle crashed on its way down, None if it did not. One that has crashed has not ``landed``.
    """

    scenario: str
    outcome: str | None
    reason: str | None
    landed: bool | None
    crash: str | None
    seed: int | None
    duration_s: float | None
    collisions: int | None
    min_clearance_m: float | None
    distance_m: float | None
    map: MapSummary
    skills: list[SkillSummary]
    resources: list[ResourceSummary]
    recovery: RecoverySummary | None
    bridge: dict[str, object] | None
    video: VideoSummary | None
    faults: list[str]
    injected: list[InjectedFault]
    answers: list[AnswerSummary]
    died: list[Death]
    mission_exit: int | None
    conformance: dict[str, object] | None
    mock: MockSummary | None
    lift_off: LiftOff
    accounts: dict[str, EncounterSummary | None]
    problems: list[str]


def read_outcome(facts: RunFacts, problems: Problems) -> tuple[str | None, str | None]:
    """Return the mission's outcome and its reason as ``mission.json`` gives them."""
    outcome: str | None = None
    reason: str | None = None
    with problems.survive("mission.json"):
        values = mapping(read_json(facts.out_dir / "mission.json"))
        outcome, reason = (str(values[name]) if values.get(name) is not None else None for name in ("outcome", "reason"))
        for problem in sequence(values.get("problems")):
            problems.note(str(problem))
        if outcome not in OUTCOMES:
            problems.note(f"mission.json names no outcome that is known: {outcome}")
            outcome = None
    if outcome == "running":
        problems.note(
            "the replay stopped before the mission's end" if facts.replay_of else "the mission's process ended before the mission did"
        )
    return outcome, reason or None


def read_bridge(facts: RunFacts, problems: Problems) -> dict[str, object] | None:
    """Return the bridge's statistics, topic by topic."""
    statistics: object = None
    with problems.survive("bridge.json"):
        statistics = mapping(read_json(facts.out_dir / "bridge.json")).get("topics")
        if not isinstance(statistics, dict):
            raise ReportError("bridge.json holds no statistics of topics")
    return mapping(statistics) or None


def came_down(history: History, recording: Recording, problems: Problems, phases: Phases, *, resting: bool | None) -> bool | None:
    """Tell whether the vehicle came down, landed or crashed: it must be said so, and be true where that is known; None: it never flew."""
    if not phases.lifted_off:
        return None
    # A recording that broke off before the lift-off tells of a vehicle that had not flown yet.
    said = [state.landed_state == ON_GROUND for state in recording.guidance[-1:] if state.t_s > phases.zero_s]
    said += [change.to_state == "ON_GROUND" for change in flight_status(history)[-1:]]
    if not said or resting is None:
        return any(said) if said else resting
    if any(said) != resting:
        problems.note(f"the vehicle is said to be {'on the ground' if any(said) else 'in the air'}, its true path ends otherwise")
    return any(said) and resting


def duration_s(history: History, recording: Recording, phases: Phases) -> float | None:
    """Return seconds from lift-off to touch-down, or to the last thing that was recorded if it never touched down."""
    if not phases.lifted_off:
        return None
    ends = [history.last_s, None if recording.path is None else float(recording.path.t_s[-1])]
    end_s = phases.touch_down_s or max((end for end in ends if end is not None), default=None)
    return phases.since(end_s)


def note_doubts(facts: RunFacts, recording: Recording, phases: Phases, problems: Problems) -> None:
    """Say what the numbers alone would hide: a flight without lift-off, faults that never came."""
    if not phases.lifted_off:
        problems.note(f"no lift-off is known: times count from {phases.zero_from}")
    broken = {fault.sensor for fault in injected(recording)}
    scenario = load_scenario(facts.scenario)
    others = dict(scenario.faults).keys() - dict(scenario.processes).keys()  # the radio's: nothing of them is in the bag
    for fault in facts.faults:
        what = parse_fault(fault).what
        if recording.simulator is not None and what not in others and what not in broken:
            problems.note(f"the fault {fault} never happened")


def summarise(
    facts: RunFacts,
    *,
    history: History,
    recording: Recording,
    phases: Phases,
    answers: Sequence[FaultAnswer],
    recovery: Recovery | None,
    recomputed: Encounter,
    resting: bool | None,
    quality: MapQuality,
    problems: Problems,
    mock: MockSummary | None = None,
    video: VideoSummary | None = None,
) -> Summary:
    """Put everything together."""
    outcome, reason = read_outcome(facts, problems)
    bridge = None if facts.mock else read_bridge(facts, problems)
    note_doubts(facts, recording, phases, problems)
    on_ground = came_down(history, recording, problems, phases, resting=resting)
    said = recording.simulator
    worst = worse(said, recomputed)
    simulated = None if said is None else Encounter(said.collisions, said.min_clearance_m, said.distance_m, said.crash)
    return Summary(
        scenario=facts.scenario,
        outcome=outcome,
        reason=reason,
        landed=False if worst.crash else on_ground,
        crash=worst.crash or None,
        seed=facts.seed,
        duration_s=duration_s(history, recording, phases),
        collisions=worst.collisions,
        min_clearance_m=_rounded(worst.min_clearance_m),
        distance_m=_rounded(worst.distance_m),
        map=_map(quality, recording),
        skills=skills(history, phases),
        resources=resources(history, phases),
        recovery=_recovery(recovery, phases),
        bridge=bridge,
        video=video,
        faults=list(facts.faults),
        injected=[InjectedFault(sensor=f.sensor, mode=f.mode, t_s=phases.since(f.t_s)) for f in injected(recording)],
        answers=[summarise_answer(one, phases) for one in answers],
        died=[Death(name=death["name"], when_s=phases.since(death["when_s"]), how=death["how"]) for death in facts.died],
        mission_exit=facts.mission_exit,
        conformance=None if facts.conformance is None else dict(facts.conformance),
        mock=mock,
        lift_off=LiftOff(stamp_s=phases.zero_s, source=phases.zero_from),
        accounts={"simulator": _encounter(simulated), "recomputed": _encounter(recomputed)},
        problems=problems.sentences,
    )


def skills(history: History, phases: Phases) -> list[SkillSummary]:
    """Return the executions in the order of their requests."""
    return [
        SkillSummary(
            skillset=execution.skillset,
            skill=execution.skill,
            id=execution.id,
            inputs=execution.inputs,
            start_s=phases.since(execution.start_s),
            running_s=phases.since(execution.running_s),
            end_s=phases.since(execution.end_s),
            outcome=execution.outcome,
            result=execution.result,
            result_kind=execution.result_kind,
            message=execution.message,
        )
        for execution in history.executions
    ]


def resources(history: History, phases: Phases) -> list[ResourceSummary]:
    """Return the transitions in the order of time."""
    return [
        {
            "t_s": phases.since(change.stamp_s),
            "skillset": change.skillset,
            "resource": change.resource,
            "from": change.from_state,
            "to": change.to_state,
            "cause": change.cause,
        }
        for change in history.transitions
    ]


def _map(quality: MapQuality, recording: Recording) -> MapSummary:
    points = recording.map_points if quality.points is None else quality.points
    return MapSummary(
        points=points,
        coverage=None if quality.coverage is None else round(quality.coverage, 4),
        rmse_m=None if quality.rmse_m is None else round(quality.rmse_m, 4),
        patches_in_reach=quality.in_reach,
    )


def _recovery(recovery: Recovery | None, phases: Phases) -> RecoverySummary | None:
    if recovery is None:
        return None
    return RecoverySummary(
        failure_s=phases.since(recovery.failure_s),
        detected_s=phases.since(recovery.detected_s),
        fallback_running_s=phases.since(recovery.fallback_running_s),
        moving_again_s=phases.since(recovery.moving_again_s),
    )


def _encounter(encounter: Encounter | None) -> EncounterSummary | None:
    if encounter is None:
        return None
    return EncounterSummary(
        collisions=encounter.collisions,
        crash=encounter.crash or None,
        min_clearance_m=_rounded(encounter.min_clearance_m),
        distance_m=_rounded(encounter.distance_m),
    )


def _rounded(value_m: float | None) -> float | None:
    return None if value_m is None else round(value_m, 3)
