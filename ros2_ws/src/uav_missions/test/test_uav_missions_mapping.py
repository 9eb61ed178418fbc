from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from py_trees.common import Status
from uav_missions_fakes import SQUARE, State, World, make_mission


class Flight:
    """A mission in a fake world, flown tick by tick."""

    def __init__(self, world: World, waypoints=SQUARE) -> None:
        self.world = world
        self.mission, self.context = make_mission(world, waypoints)

    def tick(self) -> Status:
        self.mission.root.tick_once()
        return self.mission.root.status

    def fly(self, until=lambda: False, limit_s: float = 200.0) -> Status:
        end_s = self.world.now_s + limit_s
        while self.world.now_s < end_s:
            if self.tick() is not Status.RUNNING or until():
                return self.mission.root.status
            self.world.pass_time()
        pytest.fail(f"not over after {limit_s} s: {self.world.log[-8:]}")

    def fly_until_running(self, skill: str, count: int = 1) -> None:
        self.fly(until=lambda: self.world.log.count(("running", skill)) >= count)

    def settle(self) -> None:
        for _ in range(10):
            self.world.pass_time()


def test_nominal_flight_starts_the_skills_of_the_paper_in_order():
    flight = Flight(World())
    assert flight.fly() is Status.SUCCESS
    flight.settle()
    assert flight.world.starts() == ["takeoff", "lidar_mapping", "zed_depthmap", "goto_straight", "goto_straight", "goto_straight", "land"]
    targets = [handle.inputs["target"] for handle in flight.world.handles if handle.skill == "goto_straight"]
    assert [(t["x"], t["y"], t["z"]) for t in targets] == SQUARE
    assert ("end", "lidar_mapping", "INTERRUPTED") in flight.world.log
    assert ("end", "zed_depthmap", "INTERRUPTED") in flight.world.log
    assert not flight.mission.degraded
    assert not flight.world.running()
    assert not flight.world.conflicts


def test_no_leg_is_flown_before_the_zed_sees():
    flight = Flight(World())
    flight.fly_until_running("zed_depthmap")
    assert "goto_straight" not in flight.world.starts()
    flight.fly_until_running("goto_straight")
    (zed,) = [handle for handle in flight.world.handles if handle.skill == "zed_depthmap"]
    assert zed.progress == 1.0


def test_losing_the_zed_switches_to_the_lidar_in_the_same_tick():
    flight = Flight(World())
    flight.fly_until_running("goto_straight", 2)
    flight.world.break_sensor("zed")
    before = len(flight.world.log)
    flight.tick()
    assert flight.world.log[before:] == [("interrupt", "goto_straight"), ("start", "lidar_depthmap")]


def test_after_losing_the_zed_the_route_is_finished_sideways():
    flight = Flight(World())
    flight.fly_until_running("goto_straight", 2)
    flight.world.break_sensor("zed")
    before = len(flight.world.starts())
    assert flight.fly() is Status.SUCCESS
    flight.settle()
    after = flight.world.starts()[before:]
    assert after == ["lidar_depthmap", "rotate_head", "lock_head", "goto", "rotate_head", "lock_head", "goto", "land"]
    events = flight.world.log
    assert events.index(("running", "lidar_depthmap")) < events.index(("start", "rotate_head"))
    assert events.index(("end", "goto_straight", "INTERRUPTED")) < events.index(("start", "rotate_head"))
    assert events.index(("running", "lock_head")) < events.index(("start", "goto"))
    assert flight.mission.degraded
    assert not flight.world.conflicts
    assert not flight.world.running()


def test_the_interrupted_leg_is_finished_by_the_lidar_branch_with_the_nose_to_the_left_of_the_leg():
    flight = Flight(World())
    flight.fly_until_running("goto_straight", 2)
    flight.world.break_sensor("zed")
    flight.fly()
    rotations = [handle.inputs["heading"] for handle in flight.world.handles if handle.skill == "rotate_head"]
    locks = [handle.inputs["heading"] for handle in flight.world.handles if handle.skill == "lock_head"]
    targets = [handle.inputs["target"] for handle in flight.world.handles if handle.skill == "goto"]
    assert rotations == pytest.approx([math.pi / 2, math.pi])
    assert locks == pytest.approx(rotations)
    assert [(t["x"], t["y"], t["z"]) for t in targets] == SQUARE[1:]


def test_the_head_is_turned_at_corners_only():
    straight_on = [(0.0, 0.0, 3.0), (5.0, 0.0, 3.0), (9.0, 0.0, 3.0), (9.0, 4.0, 3.0)]
    world = World(broken={"zed"})
    flight = Flight(world, straight_on)
    assert flight.fly() is Status.SUCCESS
    assert world.starts().count("rotate_head") == 2
    assert world.starts().count("goto") == 4


def test_zed_broken_from_the_start_flies_with_the_lidar_alone():
    flight = Flight(World(broken={"zed"}))
    assert flight.fly() is Status.SUCCESS
    assert "goto_straight" not in flight.world.starts()
    assert flight.mission.degraded
    assert flight.world.resources["flight_status"] == "ON_GROUND"


def test_losing_both_sensors_stops_and_lands_where_it_is():
    flight = Flight(World())
    flight.fly_until_running("goto_straight", 2)
    flight.world.break_sensor("zed")
    flight.world.break_sensor("lidar")
    assert flight.fly() is Status.FAILURE
    flight.settle()
    assert flight.world.starts()[-3:] == ["lidar_depthmap", "hover", "land"]
    assert flight.world.resources["flight_status"] == "ON_GROUND"
    assert not flight.world.running()
    assert flight.context.reason == (
        "perception.zed_depthmap: RESOURCE_INVARIANT_VIOLATED zed_ok (zed_status is BROKEN); "
        "then perception.lidar_depthmap: NOT_READY sensor_ok"
    )


def test_losing_the_lidar_after_the_zed_gives_up_too():
    flight = Flight(World())
    flight.fly_until_running("goto_straight")
    flight.world.break_sensor("zed")
    flight.fly_until_running("goto")
    flight.world.break_sensor("lidar")
    assert flight.fly() is Status.FAILURE
    flight.settle()
    assert flight.world.starts()[-2:] == ["hover", "land"]
    assert not flight.world.conflicts
    assert not flight.world.running()


def test_losing_the_map_gives_up():
    world = World()
    flight = Flight(world)
    flight.fly_until_running("goto_straight", 2)
    world.script = lambda handle: "ABORTED" if handle.skill == "lidar_mapping" else None
    assert flight.fly() is Status.FAILURE
    assert flight.context.reason == "mapping.lidar_mapping: ABORTED"
    assert world.starts()[-2:] == ["hover", "land"]


@pytest.mark.parametrize("result", ["ABORTED", "BLOCKED", "FAILED"])
def test_a_take_off_that_fails_on_the_ground_ends_there(result):
    world = World(script=lambda handle: result if handle.skill == "takeoff" else None)
    flight = Flight(world)
    assert flight.fly() is Status.FAILURE
    assert world.starts() == ["takeoff", "hover"]


def test_a_take_off_that_fails_in_the_air_is_followed_by_a_landing():
    world = World(script=lambda handle: "BLOCKED" if handle.skill == "takeoff" else None)
    flight = Flight(world)
    flight.fly_until_running("takeoff")
    flight.tick()
    world.resources["flight_status"] = "IN_AIR"
    assert flight.fly() is Status.FAILURE
    assert world.starts() == ["takeoff", "hover", "land"]


def test_lifting_off_after_a_failed_take_off_is_noticed():
    world = World(script=lambda handle: "ABORTED" if handle.skill == "takeoff" else None)
    flight = Flight(world)
    flight.fly(until=lambda: ("end", "hover", "NOT_READY") in world.log)
    flight.fly(until=lambda: world.now_s > 3.0)
    world.resources["flight_status"] = "IN_AIR"
    assert flight.fly() is Status.FAILURE
    assert world.starts()[-1] == "land"


def test_a_blocked_leg_is_tried_again_after_two_seconds():
    world = World()
    blocked = []

    def block_once(handle):
        if handle.skill == "goto_straight" and not blocked:
            blocked.append(world.now_s)
            return "BLOCKED"
        return None

    world.script = block_once
    flight = Flight(world)
    assert flight.fly() is Status.SUCCESS
    assert world.starts().count("goto_straight") == len(SQUARE) + 1
    second = [handle for handle in world.handles if handle.skill == "goto_straight"][1]
    assert second.started_s - blocked[0] == pytest.approx(2.0, abs=0.25)
    assert not flight.mission.degraded


def test_a_leg_blocked_twice_is_left_to_the_lidar():
    world = World(script=lambda handle: "BLOCKED" if handle.skill == "goto_straight" else None)
    flight = Flight(world)
    assert flight.fly() is Status.SUCCESS
    assert world.starts().count("goto_straight") == 2
    assert world.starts().count("goto") == len(SQUARE)
    assert flight.mission.degraded


def test_a_leg_blocked_for_both_is_given_up():
    world = World(script=lambda handle: "BLOCKED" if handle.skill.startswith("goto") else None)
    flight = Flight(world)
    assert flight.fly() is Status.FAILURE
    assert world.starts().count("goto_straight") == world.starts().count("goto") == 2
    assert world.starts()[-2:] == ["hover", "land"]


def test_an_aborted_leg_is_not_tried_again():
    world = World(script=lambda handle: "ABORTED" if handle.skill == "goto_straight" else None)
    flight = Flight(world)
    flight.fly()
    assert world.starts().count("goto_straight") == 1


def test_when_the_pilot_takes_over_nothing_more_is_commanded():
    flight = Flight(World())
    flight.fly_until_running("goto_straight", 2)
    commands = len(flight.world.starts())
    flight.world.take_authority()
    assert flight.fly(limit_s=400.0) is Status.FAILURE
    flight.settle()
    assert flight.world.starts()[commands:] == []
    assert not flight.world.running()
    assert "keep_sdk_authority" in flight.context.reason


@pytest.mark.parametrize("away_s", [0.0, 2.0, 60.0])
def test_a_vehicle_that_is_given_back_is_landed_where_it_is(away_s):
    flight = Flight(World())
    world = flight.world
    flight.fly_until_running("goto_straight", 2)
    commands = len(world.starts())
    world.take_authority()
    taken_s = world.now_s
    flight.fly(until=lambda: world.now_s >= taken_s + away_s, limit_s=100.0)
    world.resources["SDK_authority"] = "AVAILABLE"
    back_s = world.now_s
    assert flight.fly(limit_s=400.0) is Status.FAILURE
    assert world.starts()[commands:] == ["hover", "land"]
    assert world.handles[-2].started_s - back_s > 2.9, "not while the pilot still turns his switch"
    assert world.resources["flight_status"] == "ON_GROUND"
    assert "keep_sdk_authority" in flight.context.reason


def test_a_vehicle_that_is_taken_again_while_it_lands_is_left_alone_again():
    world = World(script=lambda handle: "BLOCKED" if handle.skill == "land" and world.log.count(("running", "land")) == 1 else None)
    flight = Flight(world)
    flight.fly_until_running("goto_straight", 2)
    world.take_authority()
    world.resources["SDK_authority"] = "AVAILABLE"
    flight.fly(until=lambda: "land" in world.starts(), limit_s=100.0)
    world.take_authority()
    commands, taken_s = len(world.starts()), world.now_s
    flight.fly(until=lambda: world.now_s > taken_s + 60.0, limit_s=100.0)
    assert world.starts()[commands:] == []
    world.resources["SDK_authority"] = "AVAILABLE"
    assert flight.fly(limit_s=400.0) is Status.FAILURE
    assert set(world.starts()[commands:]) == {"hover", "land"}
    assert world.resources["flight_status"] == "ON_GROUND"


def test_a_vehicle_that_is_given_back_for_a_moment_after_it_was_taken_again_gets_no_command():
    world = World(script=lambda handle: "BLOCKED" if handle.skill == "land" else None)
    flight = Flight(world)
    flight.fly_until_running("goto_straight", 2)
    world.take_authority()
    world.resources["SDK_authority"] = "AVAILABLE"
    flight.fly(until=lambda: "land" in world.starts(), limit_s=100.0)
    world.take_authority()
    commands, taken_s = len(world.starts()), world.now_s
    flight.fly(until=lambda: world.now_s > taken_s + 2.5)
    world.resources["SDK_authority"] = "AVAILABLE"
    flight.fly(until=lambda: world.now_s > taken_s + 4.5)
    world.resources["SDK_authority"] = "UNAVAILABLE"
    flight.fly(until=lambda: world.now_s > taken_s + 20.0)
    assert world.starts()[commands:] == []


def test_a_vehicle_that_is_taken_is_waited_for_until_it_has_stood_for_a_while():
    flight = Flight(World())
    world = flight.world
    flight.fly_until_running("goto_straight", 2)
    world.take_authority()
    taken_s = world.now_s
    flight.fly(until=lambda: world.now_s > taken_s + 20.0)
    world.resources["flight_status"] = "ON_GROUND"  # what an autopilot that restarts in the air says, too
    stood_s = world.now_s
    assert flight.fly() is Status.FAILURE
    assert world.now_s - stood_s == pytest.approx(3.0, abs=0.3)


def test_a_pilot_who_flies_through_guided_gets_no_command():
    flight = Flight(World())
    world = flight.world
    flight.fly_until_running("goto_straight", 2)
    commands = len(world.starts())
    world.take_authority()
    begun_s = world.now_s

    def switching() -> bool:
        world.resources["SDK_authority"] = "AVAILABLE" if (world.now_s - begun_s) % 5.0 < 2.0 else "UNAVAILABLE"
        return world.now_s > begun_s + 100.0

    flight.fly(until=switching, limit_s=200.0)
    assert world.starts()[commands:] == []


def test_a_moment_without_authority_while_giving_up_is_not_taken_for_the_pilot():
    flight = Flight(World())
    flight.fly_until_running("goto_straight", 2)
    flight.world.break_sensor("zed")
    flight.world.break_sensor("lidar")
    flight.world.resources["SDK_authority"] = "UNAVAILABLE"
    resume_s = flight.world.now_s + 1.5
    flight.fly(until=lambda: flight.world.now_s > resume_s)
    flight.world.resources["SDK_authority"] = "AVAILABLE"
    assert flight.fly() is Status.FAILURE
    assert flight.world.starts()[-1] == "land"


def test_a_landing_that_fails_is_tried_again():
    world = World()
    failures = iter(["BLOCKED", "FAILED"])
    world.script = lambda handle: next(failures, None) if handle.skill == "land" else None
    flight = Flight(world)
    assert flight.fly() is Status.FAILURE
    assert world.starts().count("land") == 3
    assert world.resources["flight_status"] == "ON_GROUND"


def test_an_interruption_that_never_ends_delays_a_start_for_the_bound_only():
    world = World(interrupt_takes_s=1e9)
    flight = Flight(world)
    flight.fly_until_running("goto_straight")
    world.break_sensor("zed")
    flight.fly(until=lambda: "rotate_head" in world.starts())
    (interrupted,) = [handle for handle in world.handles if handle.skill == "goto_straight"]
    (rotation,) = [handle for handle in world.handles if handle.skill == "rotate_head"]
    assert rotation.started_s - interrupted.interrupted_s == pytest.approx(5.0, abs=0.25)


def test_stopping_the_tree_and_landing_is_what_an_abort_does():
    flight = Flight(World())
    flight.fly_until_running("goto_straight", 2)
    flight.mission.root.stop(Status.INVALID)
    landing = flight.mission.stop_here()
    while flight.world.now_s < 60.0 and landing.status is not Status.SUCCESS:
        landing.tick_once()
        flight.world.pass_time()
    assert landing.status is Status.SUCCESS
    assert flight.world.starts()[-2:] == ["hover", "land"]
    assert not flight.world.conflicts
    assert not flight.world.running()


RESULTS = ["ARRIVED", "AT_ALTITUDE", "ALIGNED", "BLOCKED", "ABORTED", "LOST", "FAILED", "DONE", "LANDED", None]


@settings(max_examples=150)
@given(
    results=st.lists(st.sampled_from(RESULTS), max_size=25),
    breaks=st.lists(st.tuples(st.floats(0.0, 25.0), st.sampled_from(["zed", "lidar", "pilot"])), max_size=3),
    interrupt_takes_s=st.floats(0.0, 2.0),
)
def test_whatever_happens_nothing_runs_on_and_no_resource_is_asked_for_twice(results, breaks, interrupt_takes_s):
    world = World(interrupt_takes_s=interrupt_takes_s)
    answers = iter(results)
    own = {"takeoff", "goto", "goto_straight", "rotate_head", "hover", "land", "lidar_mapping"}
    world.script = lambda handle: next(answers, None) if handle.skill in own else None
    flight = Flight(world)

    def misfortune() -> bool:
        for when_s, what in list(breaks):
            if world.now_s >= when_s:
                breaks.remove((when_s, what))
                world.take_authority() if what == "pilot" else world.break_sensor(what)
        return False

    status = flight.fly(until=misfortune, limit_s=400.0)
    for _ in range(40):
        world.pass_time()
    assert status in {Status.SUCCESS, Status.FAILURE}
    assert not world.conflicts
    assert not world.running()
    assert not flight.context.pending.names()
    assert all(handle.state is not State.REQUESTED for handle in world.handles)
