"""The report of a flight in the simulator or of a vehicle: its recordings, its map and clearance against the true world, its video."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from alula.common.faults import FaultChange
from alula.common.files import write_aside
from alula.records.causes.effects import EffectsByFault, FaultEffects
from alula.records.causes.faults import Fault
from alula.report.observed import Observed, read_faults
from alula.report.part import Entry, Findings, ReportedRun
from alula.report.phases import Phases, home, status_changes
from alula.report.recovery import Recovery
from alula.report.timeline import Timeline
from uav_report.map_picture import MapScene, draw_map
from uav_report.map_quality import Floats, MapQuality, judge_map, load_map, load_route
from uav_report.page import page_entries
from uav_report.phases import FlightPhases, flight_phases, touch_down
from uav_report.recording import ON_GROUND, Recording, Track, read_recording
from uav_report.truth import Encounter, disagreement, encounter, impact, rests, told_or_computed
from uav_report.video import Video, radio_lost_s, read_video
from uav_report.video_picture import draw_video
from uav_report.world import TrueSurfaces

RADIO = "radio"
SAME_MOMENT_S = 1.0
"""The radio publishes its state twice a second: a fault of it and its next state are no farther apart."""
UNHEARD_S = 2.0
"""A guidance that is silent for so long before the end has died: nobody knows where the vehicle is then."""
MOVING_M_S = 0.2


@dataclass(frozen=True)
class Truth:
    """The flight and its map against the simulator's true surfaces, as far as they are known."""

    world: TrueSurfaces | None = None
    recomputed: Encounter = field(default_factory=Encounter)
    resting: bool | None = None
    points: Floats | None = None
    route: Floats | None = None
    quality: MapQuality = field(default_factory=MapQuality)


class FlightReport:
    """The drone's part of a report (``alula.report.part.ReportPart``)."""

    def __init__(self, run: ReportedRun) -> None:
        self._run = run
        self._recording = Recording()
        self._phases = FlightPhases()
        self._video = Video()
        self._truth = Truth()

    def observe(self, run: ReportedRun) -> Observed:
        """Read the bag of the functional layer."""
        if run.facts.recorded:
            with run.problems.survive("functional.bag"):
                self._recording = read_recording(run.folder, run.problems)
        recording = self._recording
        simulator, path, guidance = recording.simulator, recording.path, recording.guidance
        return Observed(
            departed_s=None if simulator is None else simulator.lift_off_s,
            departed_by="simulator",
            first_s=None if path is None else float(path.t_s[0]),
            last_s=None if path is None else float(path.t_s[-1]),
            back_s=touch_down(guidance),
            is_back=guidance[-1].landed_state == ON_GROUND if guidance else None,
            faults=() if simulator is None else simulator.faults,
            tells_faults=simulator is not None,
            processes=read_faults(run.folder),
            moving_again=None if path is None else lambda since_s: moving_again(path, since_s, self._phases.landing_s),
        )

    def failures(self, phases: Phases, known: Sequence[Fault], effects: EffectsByFault) -> Iterable[tuple[FaultChange, Fault]]:
        """Return the radio that ended the video, where nothing that is known explains that."""
        run = self._run
        self._phases = flight_phases(phases, run.history, self._recording.guidance)
        if "video" in run.scenario.report:
            with run.problems.survive("video"):
                self._video = read_video(run.folder, run.history, self._phases, run.problems)
        lost_s, radio = radio_lost_s(self._video, self._phases), effects.of(RADIO)
        if lost_s is None or any(explains(fault, lost_s, radio) for fault in known):
            return []
        return [(FaultChange(RADIO, "", lost_s), Fault(RADIO, lost_s, effects=radio, injected=False))]

    def measure(self, phases: Phases, recovery: Recovery | None, timeline: Timeline | None) -> Findings:  # noqa: ARG002
        """Compare with the true world, and draw map and video."""
        self._truth = self._compare()
        self._draw(recovery, timeline)
        said, truth = self._recording.simulator, self._truth
        found = told_or_computed(said, truth.recomputed)
        down = self._came_down()
        values: dict[str, Any] = {
            "crash": found.crash or None,
            "left": self._left(down=down) or None,
            "collisions": found.collisions,
            "min_clearance_m": _rounded(found.min_clearance_m),
            "distance_m": _rounded(found.distance_m),
            "map": _map(truth.quality, self._recording),
            "video": self._video.summary,
        }
        return Findings(values, False if found.crash else down)

    def entries(self) -> Iterable[Entry]:
        """Return path, true surfaces, and the verdicts of the sensors' watches."""
        return page_entries(self._recording, self._truth.world)

    def _came_down(self) -> bool | None:
        """Return whether the vehicle came down: it must be said so, and be true where that is known; None: it never flew."""
        phases, resting, place = self._phases, self._truth.resting, home()
        if not phases.lifted_off:
            return None
        # A recording that broke off before the lift-off has a vehicle that had not flown yet.
        said = [state.landed_state == ON_GROUND for state in self._recording.guidance[-1:] if state.t_s > phases.zero_s]
        said += [place is not None and change.to_state == place[1] for change in status_changes(self._run.history)[-1:]]
        if not said or resting is None:
            return any(said) if said else resting
        if any(said) != resting:
            where = "on the ground" if any(said) else "in the air"
            self._run.problems.note(f"the vehicle is said to be {where}, its true path ends otherwise")
        return any(said) and resting

    def _left(self, *, down: bool | None) -> str:
        """Say how a vehicle that has flown is left, where that is not on the ground with its motors off.

        A recording that broke off in the air says nothing of one that is known to have come ``down``.
        """
        guidance, phases = self._recording.guidance, self._phases
        if not guidance or not phases.lifted_off or guidance[-1].t_s <= phases.zero_s or (down and guidance[-1].landed_state != ON_GROUND):
            return ""
        left, unheard_s = guidance[-1].left, self._recording.last_s - guidance[-1].t_s
        return f"{left}, as the guidance said last, {unheard_s:.0f} s before the end" if left and unheard_s > UNHEARD_S else left

    def _compare(self) -> Truth:
        """Compare with the true world, where there is one: the path first, then the map."""
        folder, problems, recording, phases = self._run.folder, self._run.problems, self._recording, self._phases
        world: TrueSurfaces | None = None
        with problems.survive("world.ply"):
            world = TrueSurfaces.load(folder / "world.ply")
        recomputed, resting = Encounter(), None
        with problems.survive("the clearance to the true surfaces"):
            recomputed = encounter(recording.truth, world, phases)
            resting = rests(recording.truth, world, phases)
            if resting and (how := impact(recording.truth, phases)):
                recomputed = replace(recomputed, crash=how, collisions=max(recomputed.collisions or 0, 1))
            if different := disagreement(recording, recomputed):
                problems.note(different)
        points: Floats | None = None
        route: Floats | None = None
        if "map" in self._run.scenario.report and (self._run.scenario.mission or (folder / "map.ply").exists()):
            with problems.survive("map.ply"):
                points = load_map(folder / "map.ply")
        if self._run.scenario.mission:  # who only serves skills has no route
            with problems.survive("the route of the mission"):
                route = load_route(self._run.history.mission)
        quality = MapQuality()
        with problems.survive("the map's quality"):
            quality = judge_map(points, route, world, problems)
        return Truth(world, recomputed, resting, points, route, quality)

    def _draw(self, recovery: Recovery | None, timeline: Timeline | None) -> None:
        run, video = self._run, self._video
        if video.frames and timeline is not None:
            with run.problems.survive("video.svg"):
                write_aside(run.folder / "video.svg", lambda aside: draw_video(video, timeline, aside, title=run.title))
        with run.problems.survive("map.png"):
            write_aside(run.folder / "map.png", lambda aside: draw_map(self._scene(recovery), aside, title=run.title))

    def _scene(self, recovery: Recovery | None) -> MapScene:
        truth = self._truth
        failure_s = recovery.failure_s or recovery.detected_s if recovery is not None else None
        failed = "" if recovery is None else recovery.failed
        return MapScene(truth.points, truth.quality.missed_enu_m, truth.world, truth.route, self._recording.path, failure_s, failed)


def explains(fault: Fault, lost_s: float, radio: FaultEffects) -> bool:
    """Return whether a fault explains the loss of the radio: a process of the video, or the radio at that moment."""
    if fault.name == RADIO:
        return abs(fault.at_s - lost_s) < SAME_MOMENT_S
    return fault.holds(lost_s) and bool(fault.effects.ends & radio.ends)


def moving_again(track: Track, since_s: float, landing_s: float | None) -> float | None:
    """Return when the vehicle is first fast (horizontally) from ``since_s`` on, when a motion skill runs again; None if it never is."""
    part = (track.t_s >= since_s) & (track.t_s < (np.inf if landing_s is None else landing_s))
    fast = track.t_s[part][track.horizontal_speed_m_s()[part] > MOVING_M_S]
    return float(fast[0]) if len(fast) else None


def _map(quality: MapQuality, recording: Recording) -> dict[str, Any]:
    return {
        "points": recording.map_points if quality.points is None else quality.points,
        "coverage": None if quality.coverage is None else round(quality.coverage, 4),
        "rmse_m": None if quality.rmse_m is None else round(quality.rmse_m, 4),
        "patches_in_reach": quality.in_reach,
    }


def _rounded(value_m: float | None) -> float | None:
    return None if value_m is None else round(value_m, 3)
