"""The skillsets on a live ROS graph, with the functional layer faked."""

from __future__ import annotations

import math

import pytest

pytest.importorskip("rclpy")

from uav_skills_functional_fake import AHEAD_S, STEP_M, STEP_S
from uav_skills_rig import SKILLSETS, Rig

from uav_skills.functional import WATCH_PERIOD_S

LAG_S = AHEAD_S + 2 * STEP_S
"""So far what a node has heard (clock, or the last message before a silence) may be behind the clock of the functional layer."""
CRITERIA = {"min_fps": 8.0, "min_quality": 0.4, "patience": 3.0}


@pytest.fixture(scope="module")
def whole_rig(ros2_domain):
    rig = Rig()
    yield rig
    rig.close()


@pytest.fixture
def rig(whole_rig):
    whole_rig.prepare()
    yield whole_rig
    for node in whole_rig.nodes[:-1]:
        for execution in node.engine.executions:
            node.engine.interrupt(execution.id)
        whole_rig.wait(lambda node=node: not node.engine.executions)


def test_takeoff_ends_at_altitude_and_gives_the_axes_back(rig):
    handle = rig.start("navigation", "takeoff", height=3.0, speed=2.0)
    assert rig.ended(handle) == ("TERMINATED", "AT_ALTITUDE")
    assert rig.functional.names() == ["takeoff"]
    assert rig.functional.calls[0][1].height_m == 3.0
    rig.wait(lambda: rig.clients["navigation"].resources["axes_authority"] == "AVAILABLE")


def test_a_takeoff_that_does_not_climb_is_blocked_and_stopped(rig):
    rig.functional.vehicle.stuck = True
    handle = rig.start("navigation", "takeoff", height=3.0, speed=2.0)
    assert rig.ended(handle) == ("TERMINATED", "BLOCKED")
    rig.wait(lambda: rig.functional.names() == ["takeoff", "hover"])
    assert rig.functional.vehicle.still_s < 7.0


def test_wrong_inputs_reach_no_function(rig):
    handle = rig.start("navigation", "takeoff", height=3.0, speed=9.0)
    assert rig.ended(handle) == ("NOT_VALIDATED", "")
    assert "speed is 9 m/s" in handle.message
    assert rig.functional.names() == []


@pytest.mark.parametrize(("skill", "heading"), [("goto", 1), ("goto_straight", 0)])
def test_a_flight_arrives_and_tells_its_progress(rig, skill, heading):
    rig.in_air()
    handle = rig.start("navigation", skill, target=(6.0, 0.0, 3.0), speed=1.0)
    seen = []
    rig.wait(lambda: handle.done or seen.append(handle.progress))
    assert (handle.outcome, handle.result) == ("TERMINATED", "ARRIVED"), handle.message
    assert any(0.1 < progress < 1.0 for progress in seen)
    assert seen == sorted(seen)
    ((name, request),) = rig.functional.calls
    assert (name, request.heading, request.speed_m_s) == ("set_position", heading, 1.0)


def test_an_interrupted_flight_hovers(rig):
    handle = rig.start_long_flight("goto_straight")
    rig.wait(lambda: rig.functional.vehicle.reference == "position")
    handle.interrupt()
    assert rig.ended(handle) == ("INTERRUPTED", "")
    rig.wait(lambda: rig.functional.vehicle.reference == "hover")


def test_a_flight_that_rests_goes_on_to_its_target(rig):
    handle = rig.start_long_flight("goto")
    rig.wait(lambda: rig.functional.vehicle.reference == "position")
    engine = rig.nodes[0].engine
    rig.wait(lambda: engine.pause(handle.id).accepted)
    rig.wait(lambda: rig.functional.vehicle.reference == "hover")
    assert engine.execution(handle.id).state.value == "PAUSED"
    rig.functional.vehicle.step_m = STEP_M
    assert engine.resume(handle.id).accepted
    assert rig.ended(handle) == ("TERMINATED", "ARRIVED")
    assert rig.functional.names() == ["set_position", "hover", "set_position"]


def test_interrupting_at_once_still_stops_last(rig):
    handle = rig.start_long_flight("goto")
    handle.interrupt()
    assert rig.ended(handle)[0] == "INTERRUPTED"
    rig.wait(lambda: rig.functional.names()[-1:] == ["hover"])


def test_a_refused_flight_carries_the_reason(rig):
    rig.in_air()
    rig.functional.vehicle.refuse = "target is outside the fence"
    handle = rig.start("navigation", "goto", target=(5.0, 0.0, 3.0), speed=1.0)
    assert rig.ended(handle) == ("TERMINATED", "ABORTED")
    assert handle.message == "refused: target is outside the fence"


@pytest.fixture
def unanswered(rig, monkeypatch):
    """Return what has a service of the guidance answer no more: its responses are lost, or the calls. It returns the guidance."""
    from rclpy.task import Future

    def lose(name):
        guidance = next(hook.guidance for hook in rig._hooks if hasattr(hook, "guidance"))
        monkeypatch.setattr(getattr(guidance, f"_{name}"), "call_async", lambda _request: Future())
        return guidance

    return lose


def test_a_flight_whose_command_is_not_answered_was_not_refused(rig, unanswered):
    rig.in_air()
    unanswered("position")
    handle = rig.start("navigation", "goto", target=(5.0, 0.0, 3.0), speed=1.0)
    assert rig.ended(handle) == ("TERMINATED", "ABORTED")
    assert handle.message == "service /uav_guidance/set_position does not answer for 20 s"
    rig.wait(lambda: rig.functional.names() == ["hover"])  # it may have arrived, or still arrive


def test_a_flight_whose_guidance_goes_silent_before_it_answers_ends_by_the_silence(rig, unanswered):
    rig.in_air()
    unanswered("position")
    rig.functional.vehicle.silent, began_s = True, rig.functional.now_s
    handle = rig.start("navigation", "goto", target=(5.0, 0.0, 3.0), speed=1.0)
    assert rig.ended(handle) == ("TERMINATED", "ABORTED")
    assert "nothing is heard of the guidance for 3." in handle.message
    assert rig.functional.now_s - began_s < 10.0
    rig.wait(lambda: rig.functional.names() == ["hover"])


def test_a_hover_that_is_not_answered_is_not_followed_by_another(rig, unanswered):
    rig.in_air()
    guidance = unanswered("hover")
    rig.functional.vehicle.silent = True
    handle = rig.start("navigation", "hover", duration=2.0)
    assert rig.ended(handle) == ("TERMINATED", "ABORTED")
    assert "nothing is heard of the guidance" in handle.message
    assert len(guidance._calls._calls) == 1


def test_drifting_off_the_line_aborts_and_stops(rig):
    rig.in_air()
    rig.functional.vehicle.drift_m = 3.5
    handle = rig.start("navigation", "goto", target=(20.0, 0.0, 3.0), speed=1.0)
    assert rig.ended(handle) == ("TERMINATED", "ABORTED")
    rig.wait(lambda: rig.functional.names()[-1] == "hover")


@pytest.mark.parametrize("how", ["dropped", "overtaken", "silent"])
def test_a_flight_whose_reference_is_lost_aborts(rig, how):
    handle = rig.start_long_flight("goto")
    rig.wait(lambda: handle.progress > 0.0)
    vehicle = rig.functional.vehicle
    if how == "dropped":
        vehicle.reference = "idle"  # keeps the id, has nothing to go: that is no arrival
    elif how == "overtaken":
        vehicle.reference_id += 5
    else:
        vehicle.silent = True
    assert rig.ended(handle) == ("TERMINATED", "ABORTED")
    assert ("nothing is heard of the guidance" if how == "silent" else "does not follow this reference") in handle.message
    rig.wait(lambda: rig.functional.names()[-1:] == ["hover"])


def test_a_flight_that_another_reference_lands_is_not_held_up_by_a_hover(rig):
    handle = rig.start_long_flight("goto")
    rig.wait(lambda: handle.progress > 0.0)
    rig.functional.vehicle.reference, rig.functional.vehicle.reference_id = "land", rig.functional.vehicle.reference_id + 5
    assert rig.ended(handle) == ("TERMINATED", "ABORTED")
    rig.wait(rig._calls_are_answered)
    assert "hover" not in rig.functional.names()


def test_losing_the_authority_ends_the_flight_without_another_command(rig):
    handle = rig.start_long_flight("goto")
    rig.wait(lambda: rig.functional.vehicle.reference == "position")
    rig.set("navigation", "SDK_authority", "UNAVAILABLE")
    assert rig.ended(handle) == ("RESOURCE_INVARIANT_VIOLATED", "keep_sdk_authority")
    calls_then, later_s = rig.functional.names(), rig.functional.now_s + 2.0
    rig.wait(lambda: rig.functional.now_s > later_s)
    assert rig.functional.names() == calls_then == ["set_position"]


def test_turning_and_holding_a_heading_while_flying(rig):
    rig.in_air()
    turn = rig.start("navigation", "rotate_head", heading=math.pi / 2, rate=0.6)
    assert rig.ended(turn) == ("TERMINATED", "ALIGNED")
    lock = rig.start("navigation", "lock_head", heading=math.pi / 2)
    rig.wait(lambda: rig.functional.vehicle.locked)
    flight = rig.start("navigation", "goto", target=(4.0, 0.0, 3.0), speed=1.0)
    assert rig.ended(flight) == ("TERMINATED", "ARRIVED")
    assert not lock.done
    assert rig.functional.vehicle.yaw == pytest.approx(math.pi / 2, abs=0.06)
    lock.interrupt()
    assert rig.ended(lock) == ("INTERRUPTED", "")
    rig.wait(lambda: not rig.functional.vehicle.locked)
    assert "hover" not in rig.functional.names()


def test_a_lock_that_does_not_hold_aborts(rig):
    rig.in_air()
    lock = rig.start("navigation", "lock_head", heading=1.0)
    rig.wait(lambda: lock.progress == 1.0)
    rig.functional.vehicle.locked = False
    assert rig.ended(lock) == ("TERMINATED", "ABORTED")
    assert "not locked" in lock.message


def test_hovering_lasts_as_long_as_asked_on_the_mission_clock(rig):
    rig.in_air()
    since_s = rig.functional.now_s
    assert rig.ended(rig.start("navigation", "hover", duration=2.0)) == ("TERMINATED", "DONE")
    assert 2.0 - LAG_S <= rig.functional.now_s - since_s < 4.0


def test_landing_ends_on_the_ground_with_the_motors_off(rig):
    rig.in_air()
    assert rig.ended(rig.start("navigation", "land")) == ("TERMINATED", "LANDED")
    assert rig.functional.names() == ["land"]
    assert not rig.functional.vehicle.armed


@pytest.mark.parametrize(("skill", "node"), [("zed_depthmap", "zed_depth"), ("lidar_depthmap", "lidar_obstacles")])
def test_a_depth_map_sees_until_it_is_interrupted(rig, skill, node):
    handle = rig.start("perception", skill)
    rig.wait(lambda: handle.progress == 1.0)
    handle.interrupt()
    assert rig.ended(handle) == ("INTERRUPTED", "")
    rig.wait(lambda: rig.functional.calls == [(f"{node}.enable", True), (f"{node}.enable", False)])


def test_both_depth_maps_are_watched_by_one_timer(rig):
    node = rig.nodes[SKILLSETS.index("perception")]
    assert [timer.timer_period_ns for timer in node.timers].count(round(WATCH_PERIOD_S * 1e9)) == 1
    handles = [rig.start("perception", skill) for skill in ("zed_depthmap", "lidar_depthmap")]
    rig.wait(lambda: all(handle.progress == 1.0 for handle in handles))
    rig.functional.mute |= {"zed_depth", "lidar_obstacles"}
    assert [rig.ended(handle) for handle in handles] == [("TERMINATED", "LOST"), ("TERMINATED", "LOST")]


def test_a_depth_map_without_obstacle_messages_is_lost_after_two_seconds(rig):
    handle = rig.start("perception", "zed_depthmap")
    rig.wait(lambda: handle.progress == 1.0)
    since_s = rig.functional.now_s
    rig.functional.mute.add("zed_depth")
    assert rig.ended(handle) == ("TERMINATED", "LOST")
    assert 2.0 - LAG_S <= rig.functional.now_s - since_s < 4.0
    rig.wait(lambda: rig.functional.enabled["zed_depth"] is False)


def test_a_broken_sensor_ends_its_depth_map_and_switches_it_off(rig):
    handle = rig.start("perception", "zed_depthmap")
    rig.wait(lambda: handle.progress == 1.0)
    rig.set("perception", "zed_status", "BROKEN")
    assert rig.ended(handle) == ("RESOURCE_INVARIANT_VIOLATED", "zed_ok")
    rig.wait(lambda: rig.functional.enabled["zed_depth"] is False)


def test_mapping_writes_the_map_when_it_is_interrupted(rig):
    handle = rig.start("mapping", "lidar_mapping")
    rig.wait(lambda: handle.progress == 1.0)
    handle.interrupt()
    assert rig.ended(handle) == ("INTERRUPTED", "")
    rig.wait(lambda: rig.functional.calls == [("lidar_mapping.enable", True), ("lidar_mapping.enable", False), ("save", None)])


def test_mapping_that_registers_nothing_more_aborts(rig):
    handle = rig.start("mapping", "lidar_mapping")
    rig.wait(lambda: handle.progress == 1.0)
    rig.functional.mute.add("lidar_mapping")
    rig.functional.report("perception", "lidar_status", "BROKEN", "no clouds for 0.4 s")
    assert rig.ended(handle) == ("TERMINATED", "ABORTED")
    assert handle.message.endswith("; the LiDAR: no clouds for 0.4 s"), handle.message


def test_a_stream_is_sent_until_it_is_interrupted(rig):
    handle = rig.start("video", "stream", **CRITERIA)
    rig.wait(lambda: handle.progress == 1.0)
    handle.interrupt()
    assert rig.ended(handle) == ("INTERRUPTED", "")
    rig.wait(lambda: rig.functional.calls == [("stream", True), ("stream", False)])


@pytest.mark.parametrize(("how", "why"), [("dead", "nothing was heard of the video encoder"), ("restarted", "was started again")])
def test_an_encoder_that_dies_or_is_restarted_is_not_told_as_a_bad_picture(rig, how, why):
    handle = rig.start("video", "stream", **CRITERIA)
    rig.wait(lambda: handle.progress == 1.0)
    since_s = rig.functional.now_s
    if how == "dead":
        rig.functional.mute.add("video_stream")
    else:
        rig.functional.enabled["video_stream"] = False
    assert rig.ended(handle) == ("TERMINATED", "LOST")
    assert why in handle.message
    assert 1.0 - LAG_S <= rig.functional.now_s - since_s < 3.0
    assert rig.clients["video"].resources["encoder"] == "IDLE"
