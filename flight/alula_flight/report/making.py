"""The report's main flow: from what a run left in its folder to numbers and pictures."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

from alula.common.files import write_aside, write_json
from alula.common.record import FILE as RECORD
from alula.common.runs import INPUTS_FILE
from alula.common.scenarios import Scenario, load_scenario
from alula.records.causes.fault_file import reaches_of_robot
from alula.records.causes.reach import Reaches
from alula_flight.report.answers import FaultAnswer, find_answers
from alula_flight.report.events import History, read_history
from alula_flight.report.facts import RunFacts
from alula_flight.report.files import Problems
from alula_flight.report.map_picture import MapScene, draw_map
from alula_flight.report.map_quality import Floats, MapQuality, judge_map, load_map, load_route
from alula_flight.report.mocked import MockSummary, read_mock
from alula_flight.report.page import page_entries
from alula_flight.report.phases import Phases, find_phases
from alula_flight.report.recording import Recording, read_process_faults, read_recording
from alula_flight.report.recovery import Recovery, find_recovery
from alula_flight.report.summary import Summary, summarise
from alula_flight.report.timeline import make_timeline
from alula_flight.report.timeline_picture import draw_timeline
from alula_flight.report.truth import Encounter, disagreements, encounter, impact, rests
from alula_flight.report.video import Video, radio_lost_s, read_video
from alula_flight.report.video_picture import draw_video
from alula_flight.report.world import TrueSurfaces
from mission_console.page import write_report


@dataclass(frozen=True)
class Truth:
    """The flight and its map against the simulator's true surfaces, as far as they are known."""

    world: TrueSurfaces | None = None
    recomputed: Encounter = field(default_factory=Encounter)
    resting: bool | None = None
    points: Floats | None = None
    route: Floats | None = None
    quality: MapQuality = field(default_factory=MapQuality)


@dataclass(frozen=True)
class Account:
    """What happened in the skillsets, and what the functional layer recorded."""

    history: History
    recording: Recording
    mock: MockSummary | None
    phases: Phases
    video: Video
    answers: tuple[FaultAnswer, ...]
    recovery: Recovery | None

    @property
    def failed(self) -> str:
        """What the recovery is from, or nothing."""
        return "" if self.recovery is None else self.recovery.failed


def make_report(facts: RunFacts) -> Summary:
    """Make ``timeline.json``, ``timeline.svg``, ``map.png``, ``summary.json`` and ``report.html`` in the run's folder; return the summary.

    Whatever is missing, cut off, makes no sense or can't be written is named in the summary's ``problems``; numbers that depend on it
    are None.
    """
    problems, scenario = Problems(), load_scenario(facts.scenario)
    account = _account(facts, scenario, problems)
    truth = Truth() if facts.mock else _compare(facts.out_dir, account, problems, mapped="map" in scenario.report)
    _draw_pictures(facts, account, truth, problems)
    # The numbers come behind the pictures, because they tell what went wrong with the rest.
    summary = summarise(
        facts,
        history=account.history,
        recording=account.recording,
        phases=account.phases,
        answers=account.answers,
        recovery=account.recovery,
        recomputed=truth.recomputed,
        resting=truth.resting,
        quality=truth.quality,
        mock=account.mock,
        video=account.video.summary,
        problems=problems,
    )
    _write_summary(facts.out_dir, summary)
    _write_page(facts, account, truth, summary)
    return summary


def _account(facts: RunFacts, scenario: Scenario, problems: Problems) -> Account:
    folder, history, recording, mock, video = facts.out_dir, History(), Recording(), None, Video()
    with problems.survive(RECORD):
        history = read_history(folder / RECORD, problems)
    if facts.mock:
        recording, mock = read_mock(folder, problems)
    else:
        with problems.survive("functional.bag"):
            recording = read_recording(folder, problems)
        recording = replace(recording, processes=read_process_faults(folder))
    phases = find_phases(history, recording)
    if "video" in scenario.report and not facts.mock:
        with problems.survive("video"):
            video = read_video(folder, history, phases, problems)
    reaches = Reaches()
    with problems.survive("what faults can bring about"):
        reaches = reaches_of_robot()
    answers = find_answers(facts, scenario, history, recording, phases, reaches, radio_lost_s=radio_lost_s(video, phases))
    recovery = find_recovery(scenario, history, recording, phases, answers)
    return Account(history, recording, mock, phases, video, answers, recovery)


def _draw_pictures(facts: RunFacts, account: Account, truth: Truth, problems: Problems) -> None:
    folder, title = facts.out_dir, _title(facts)
    with problems.survive("timeline"):
        timeline = make_timeline(account.history, account.phases, account.recovery)
        write_json(folder / "timeline.json", timeline)
        write_aside(folder / "timeline.svg", lambda aside: draw_timeline(timeline, aside, title=title))
        if account.video.frames:
            with problems.survive("video.svg"):
                write_aside(folder / "video.svg", lambda aside: draw_video(account.video, timeline, aside, title=title))
    if not facts.mock:
        with problems.survive("map.png"):
            write_aside(folder / "map.png", lambda aside: draw_map(_map_scene(account, truth), aside, title=title))


def _map_scene(account: Account, truth: Truth) -> MapScene:
    recovery = account.recovery
    failure_s = recovery.failure_s or recovery.detected_s if recovery is not None else None
    return MapScene(truth.points, truth.quality.missed_enu_m, truth.world, truth.route, account.recording.path, failure_s, account.failed)


def _write_page(facts: RunFacts, account: Account, truth: Truth, summary: Summary) -> None:
    """Write the page, of all that is in the folder by now."""
    problems = Problems()
    with problems.survive("report.html"):
        write_report(facts.out_dir, page_entries(account.recording, truth.world), title=_title(facts))
    if problems.sentences:
        summary["problems"] = [*summary["problems"], *problems.sentences]
        _write_summary(facts.out_dir, summary)


def _write_summary(folder: Path, summary: Summary) -> None:
    try:
        write_json(folder / "summary.json", summary)
    except OSError as error:
        summary["problems"].append(f"summary.json could not be written: {error.strerror or error}")


def _compare(folder: Path, account: Account, problems: Problems, *, mapped: bool) -> Truth:
    """Compare with the true world, where there is one: the path first, then the map."""
    recording, phases = account.recording, account.phases
    world: TrueSurfaces | None = None
    with problems.survive("world.ply"):
        world = TrueSurfaces.load(folder / "world.ply")
    recomputed, resting = Encounter(), None
    with problems.survive("the clearance to the true surfaces"):
        recomputed = encounter(recording.truth, world, phases)
        resting = rests(recording.truth, world, phases)
        if resting and (how := impact(recording.truth, phases)):
            recomputed = replace(recomputed, crash=how, collisions=max(recomputed.collisions or 0, 1))
        for sentence in disagreements(recording, recomputed):
            problems.note(sentence)
    points: Floats | None = None
    route: Floats | None = None
    if mapped:
        with problems.survive("map.ply"):
            points = load_map(folder / "map.ply")
    with problems.survive(INPUTS_FILE):
        route = load_route(folder / INPUTS_FILE)
    quality = MapQuality()
    with problems.survive("the map's quality"):
        quality = judge_map(points, route, world, problems)
    return Truth(world, recomputed, resting, points, route, quality)


def _title(facts: RunFacts) -> str:
    failing = f", failing {', '.join(facts.faults)}" if facts.faults else ""
    if facts.replay_of:
        return f"{facts.scenario}{failing}, replay of {facts.replay_of}"
    return f"{facts.scenario}, seed {facts.seed}{failing}{', over mocks' if facts.mock else ''}"
