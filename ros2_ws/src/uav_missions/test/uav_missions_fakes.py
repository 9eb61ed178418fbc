"""A skillset without ROS for the tests of trees: it obeys a script, and complains about what a real one would refuse."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass, field

from alula.common.scenarios import load_scenario
from alula.missions.context import MissionContext
from alula.missions.director import Mission
from alula.missions.plan import MissionPlan
from alula.missions.scenario import plan_of
from alula.model.execution_state import ExecutionState as State
from alula.records.models import robot_skillsets
from alula.runtime.handle import SkillHandle
from alula.runtime.waiting import Pending

SQUARE = [(0.0, 0.0, 3.0), (10.0, 0.0, 3.0), (10.0, 8.0, 3.0)]


# Which resource each skill holds while it runs.
HOLDS = {
    "takeoff": ("axes",),
    "goto": ("axes",),
    "goto_straight": ("axes", "heading"),
    "rotate_head": ("heading",),
    "lock_head": ("heading",),
    "hover": ("axes",),
    "land": ("axes",),
    "zed_depthmap": ("zed",),
    "lidar_depthmap": ("lidar",),
    "lidar_mapping": ("mapper",),
}
NOMINAL = {
    "takeoff": "AT_ALTITUDE",
    "goto": "ARRIVED",
    "goto_straight": "ARRIVED",
    "rotate_head": "ALIGNED",
    "hover": "DONE",
    "land": "LANDED",
}


PAUSABLE = {"goto", "goto_straight"}


class FakeHandle(SkillHandle):
    def __init__(self, skill: str, inputs: dict, world: World) -> None:
        super().__init__(skill, str(len(world.handles)), pause=self._hold if skill in PAUSABLE else None)
        self.inputs = inputs
        self.world = world
        self.started_s = world.now_s
        self.interrupted_s: float | None = None

    def _hold(self, paused: bool) -> Pending[str]:  # noqa: FBT001 - as handles call it
        answer: Pending[str] = Pending()
        refusal = "" if paused or self.skill not in self.world.forgets else "the way is forgotten"
        if self.skill in self.world.not_yet or self.state is State.REQUESTED:
            refusal = "not taken yet"
        if not refusal:
            self.enter(State.PAUSED if paused else State.RUNNING)
        answer.resolve(refusal)
        return answer

    def interrupt(self) -> None:
        self.interrupted_s = self.world.now_s
        self.world.log.append(("interrupt", self.skill))

    def end(self, state: State, result: str = "", message: str = "", outputs: dict | None = None) -> None:
        self.world.log.append(("end", self.skill, result or state.name))
        super().end(state, result, message, outputs)


@dataclass
class World:
    """Virtual time, three fake skillsets, a vehicle that is on the ground or in the air."""

    now_s: float = 0.0
    reasons: dict[str, str] = field(default_factory=dict)
    duration_s: float = 1.0
    interrupt_takes_s: float = 0.2
    log: list[tuple] = field(default_factory=list)
    handles: list[FakeHandle] = field(default_factory=list)
    script: Callable[[FakeHandle], str | None] = lambda _handle: None
    broken: set[str] = field(default_factory=set)
    not_yet: set[str] = field(default_factory=set)
    """Skills that refuse a pause, as they do while they are being started."""
    forgets: set[str] = field(default_factory=set)
    """Skills that can't go on after a pause."""
    conflicts: list[str] = field(default_factory=list)
    resources: dict[str, str] = field(
        default_factory=lambda: {
            "SDK_authority": "AVAILABLE",
            "flight_status": "ON_GROUND",
            "position_status": "KNOWN",
            "link": "UP",
            "height_status": "AGREED",
            "imu_status": "OK",
        }
    )

    def clock_ns(self) -> int:
        return round(self.now_s * 1e9)

    def start(self, skill: str, inputs: dict) -> FakeHandle:
        handle = FakeHandle(skill, inputs, self)
        self.log.append(("start", skill))
        for other in self.running():
            shared = set(HOLDS[skill]) & set(HOLDS[other.skill])
            if shared:
                self.conflicts.append(f"{skill} needs {shared}, held by {other.skill}")
        self.handles.append(handle)
        return handle

    def running(self) -> list[FakeHandle]:
        return [handle for handle in self.handles if not handle.done]

    def pass_time(self, dt_s: float = 0.1) -> None:
        self.now_s += dt_s
        for handle in self.running():
            self._advance(handle)

    def break_sensor(self, sensor: str) -> None:
        self.broken.add(sensor)
        for handle in self.running():
            if handle.skill == f"{sensor}_depthmap" and handle.state is State.RUNNING:
                handle.end(State.RESOURCE_INVARIANT_VIOLATED, f"{sensor}_ok", f"{sensor}_ok: {sensor}_status is BROKEN")

    def take_authority(self) -> None:
        self.resources["SDK_authority"] = "UNAVAILABLE"
        for handle in self.running():
            if "axes" in HOLDS[handle.skill] or "heading" in HOLDS[handle.skill]:
                handle.end(State.RESOURCE_INVARIANT_VIOLATED, "keep_sdk_authority")

    def _advance(self, handle: FakeHandle) -> None:
        if handle.interrupted_s is not None:
            if self.now_s - handle.interrupted_s >= self.interrupt_takes_s:
                handle.end(State.INTERRUPTED)
            return
        if handle.state is State.REQUESTED:
            self._begin(handle)
            return
        if handle.state is State.PAUSED:
            handle.started_s = self.now_s
            return
        handle.progress = 1.0 if handle.skill.endswith("depthmap") else 0.5
        if self.now_s - handle.started_s < self.duration_s:
            return
        result = self.script(handle) or NOMINAL.get(handle.skill)
        if result is None:
            return
        if handle.skill in {"takeoff", "land"} and result in {"AT_ALTITUDE", "LANDED"}:
            self.resources["flight_status"] = "IN_AIR" if handle.skill == "takeoff" else "ON_GROUND"
        handle.end(State.FAILED if result == "FAILED" else State.TERMINATED, "" if result == "FAILED" else result)

    def _begin(self, handle: FakeHandle) -> None:
        air = self.resources["flight_status"] == "IN_AIR"
        flying = "axes" in HOLDS[handle.skill] or "heading" in HOLDS[handle.skill]
        if handle.skill.partition("_")[0] in self.broken and handle.skill.endswith("depthmap"):
            handle.end(State.NOT_READY, "sensor_ok")
        elif flying and self.resources["SDK_authority"] != "AVAILABLE":
            handle.end(State.NOT_READY, "sdk_authority")
        elif flying and air is (handle.skill == "takeoff"):
            handle.end(State.NOT_READY, "on_ground" if handle.skill == "takeoff" else "in_air")
        else:
            handle.enter(State.RUNNING)
            self.log.append(("running", handle.skill))

    def starts(self) -> list[str]:
        return [entry[1] for entry in self.log if entry[0] == "start"]


@dataclass
class FakeClient:
    skillset: str
    world: World
    ready: bool = True

    @property
    def resources(self) -> dict[str, str]:
        return self.world.resources

    @property
    def reasons(self) -> dict[str, str]:
        return self.world.reasons

    def start(self, skill: str, **inputs: object) -> FakeHandle:
        return self.world.start(skill, inputs)


def clients(world: World) -> dict[str, FakeClient]:
    return {name: FakeClient(name, world) for name in ("navigation", "perception", "mapping")}


@functools.cache
def mapping_plan(waypoints: tuple[tuple[float, float, float], ...]) -> MissionPlan:
    return plan_of(load_scenario("mapping"), {"route": [list(waypoint) for waypoint in waypoints]}, robot_skillsets())


def make_mission(world: World, waypoints=SQUARE, **skillsets: FakeClient) -> tuple[Mission, MissionContext]:
    """Return the mapping mission of its file, and its memory."""
    plan = mapping_plan(tuple(waypoints))
    return plan.make(clients(world) | skillsets, world.clock_ns, plan.parameters)
