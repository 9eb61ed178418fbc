"""Failsafes and the pilot, by the numbers of the behaviours measured on ArduCopter."""

import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from uav_simulator_link import (
    ACCEPTED,
    BRAKE,
    FAILED,
    GROUND,
    GUIDED,
    LAND,
    LOITER,
    POSITION,
    POSITION_YAW,
    RTL,
    STABILIZE,
    Link,
    yaw_ned_deg,
)

from uav_simulator.autopilot.endpoint import Endpoint

# --- 19 the fence ---


@pytest.mark.parametrize(("action", "mode"), [(4.0, BRAKE), (1.0, RTL)])
def test_a_breached_fence_says_so_and_brakes_or_returns(action, mode):
    link = Link(params={"FENCE_ENABLE": 1.0, "FENCE_RADIUS": 5.0, "FENCE_ACTION": action}).flying()
    link.run_until(lambda: link.pilot.mode == mode, timeout_s=20.0, each_tick=lambda: link.setpoint(POSITION, (12.0, 0.0, -3.0)))
    assert [text.text for text in link.of("STATUSTEXT") if "Fence" in text.text] == ["Fence Breached"]
    if mode == BRAKE:
        link.run(20.0)
        held = link.position
        link.run(10.0, each_tick=lambda: link.setpoint(POSITION, (12.0, 0.0, -3.0)))
        assert (link.pilot.mode, link.pilot.armed, link.distance_to(held) < 0.15) == (BRAKE, True, True), "it hovers for ever"


# --- 18 the GPS ---

EKF, GPS = mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT, mavlink.MAVLINK_MSG_ID_GPS_RAW_INT
SYS, LOCAL = mavlink.MAVLINK_MSG_ID_SYS_STATUS, mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED
HORIZONTAL = mavlink.EKF_POS_HORIZ_ABS


def lose_gps(way):
    link = Link().flying()
    link.ask(EKF, GPS, SYS, LOCAL)
    link.run(0.3)
    assert link.of("GPS_RAW_INT")[-1].fix_type == 3
    assert link.of("EKF_STATUS_REPORT")[-1].flags == 831
    assert link.of("SYS_STATUS")[-1].onboard_control_sensors_health & 0x20
    link.received.clear()
    setattr(link.pilot.estimator.satellites, way, True)
    return link


def test_a_gps_that_is_lost_is_told_at_once_and_the_position_after_seven_seconds():
    for way, told in (("jammed", [1]), ("silent", [])):
        link = lose_gps(way)
        link.run(3.0)
        assert sorted({message.fix_type for message in link.of("GPS_RAW_INT")}) == told
        assert not link.of("SYS_STATUS")[-1].onboard_control_sensors_health & 0x20
        assert link.of("EKF_STATUS_REPORT")[-1].flags & HORIZONTAL
        link.received.clear()
        link.run(1.3)
        assert link.of("GPS_RAW_INT")[-1].fix_type == (1 if way == "jammed" else 0)
        assert link.of("LOCAL_POSITION_NED")
        link.run(2.9)
        flags = link.of("EKF_STATUS_REPORT")[-1].flags
        assert (flags & HORIZONTAL, flags & mavlink.EKF_CONST_POS_MODE) == (0, mavlink.EKF_CONST_POS_MODE)
        link.received.clear()
        link.run(0.5)
        assert not link.of("LOCAL_POSITION_NED")


def test_without_a_gps_it_drifts_and_lands_by_itself_after_8_seconds():
    link = lose_gps("silent")
    begun = link.position
    assert link.run_until(lambda: link.pilot.mode == LAND, timeout_s=10.0) == pytest.approx(7.8, abs=0.1)
    assert 0.3 < math.dist(link.position[:2], begun[:2]) < 1.5, "m: it flies by a position that runs away"
    link.run(1.1)
    assert "EKF Failsafe: changed to LAND Mode" in link.texts()
    assert link.of("HEARTBEAT")[-1].system_status == 5
    link.received.clear()
    assert link.command(176, 1, GUIDED) == FAILED
    assert "Mode change to GUIDED failed: requires position" in link.texts()
    link.run_until(lambda: not link.pilot.armed, timeout_s=20.0)


def test_a_landing_goes_on_without_a_gps_and_is_not_told_of():
    link = lose_gps("jammed")
    link.run(5.0)
    assert link.command(176, 1, LAND) == ACCEPTED
    link.run(4.0)
    assert link.of("HEARTBEAT")[-1].system_status == 5
    assert not [text for text in link.texts() if "EKF" in text]
    link.run_until(lambda: not link.pilot.armed, timeout_s=20.0)


def test_a_gps_that_comes_back_leaves_home_and_origin():
    link = lose_gps("silent")
    home = link.pilot.home
    link.run(7.2)
    assert not link.pilot.located
    link.pilot.estimator.satellites.silent = False
    link.received.clear()
    link.run(1.0)
    assert link.pilot.located
    assert (link.pilot.home, link.pilot.mode) == (home, GUIDED)
    assert not link.of("GPS_GLOBAL_ORIGIN")
    assert math.dist(link.pilot.estimate.position, link.position) < 0.05


# --- 10 failsafes --------------------------------------------------------------------------------------------------------


def test_no_ground_station_is_needed_by_default():
    link = Link().flying()
    link.endpoint.gcs_present = False
    link.run(20.0)
    assert link.pilot.mode == GUIDED


def test_with_fs_gcs_enable_it_returns_when_the_ground_station_falls_silent():
    link = Link().flying()
    link.send(mavlink.MAVLink_param_set_message(1, 1, b"FS_GCS_ENABLE", 1.0, mavlink.MAV_PARAM_TYPE_REAL32))
    assert link.of("PARAM_VALUE")[-1].param_value == 1.0
    link.endpoint.gcs_present = False
    assert link.run_until(lambda: link.pilot.mode == RTL, timeout_s=8.0) == pytest.approx(5.0, abs=1.1)


def ground_station(link):
    """Open a second link, and return it with a function that sends a heartbeat over it."""
    ground = Endpoint(link.pilot, gcs_present=False)
    link.endpoint.gcs_present = False
    link.endpoint.connect(ground)
    station = mavlink.MAVLink(None, srcSystem=255, srcComponent=190)
    beat = mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, mavlink.MAV_STATE_ACTIVE, 3)
    return ground, lambda: ground.feed(beat.pack(station))


def test_a_ground_station_on_a_link_of_its_own_is_heard_and_forwarded():
    link = Link()
    ground, beat = ground_station(link)
    beat()
    link.run(0.1)
    assert len(link.of("HEARTBEAT", system=255)) == 1
    ground.take_output()
    assert link.command(176, 1, GUIDED) == ACCEPTED
    assert link.command(21) == ACCEPTED
    heard = mavlink.MAVLink(None).parse_buffer(ground.take_output())
    assert {m.custom_mode for m in heard if m.get_type() == "HEARTBEAT"} == {GUIDED, LAND}
    assert not [m for m in heard if m.get_type() == "COMMAND_ACK"], "answers go to the link that has asked"
    link.send(mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3))
    assert [m.get_srcComponent() for m in mavlink.MAVLink(None).parse_buffer(ground.take_output())] == [191]


def test_the_control_link_is_lost_and_comes_back():
    link = Link(params={"FS_GCS_ENABLE": 1.0}).flying()
    _, beat = ground_station(link)
    for _ in range(8):
        beat()
        link.run(1.0)
    assert link.pilot.mode == GUIDED
    link.received.clear()
    assert link.run_until(lambda: link.pilot.mode == RTL, timeout_s=8.0) == pytest.approx(4.0, abs=0.3)
    link.run(1.1)
    assert "GCS Failsafe" in link.texts()
    assert link.of("HEARTBEAT")[-1].system_status == 5
    beat()
    link.run(1.1)
    assert (link.of("HEARTBEAT")[-1].custom_mode, link.of("HEARTBEAT")[-1].system_status) == (RTL, 4)


def test_rc_loss_returns_home_and_stays_when_rc_comes_back():
    link = Link().flying()
    link.setpoint(POSITION, (0, 8, -3))
    link.run(8.0)
    link.pilot.set_rc(lost=True)
    link.run(1.2)
    assert (link.of("HEARTBEAT")[-1].custom_mode, link.of("HEARTBEAT")[-1].system_status) == (RTL, 5)
    link.pilot.set_rc(lost=False)
    link.run(1.2)
    assert (link.of("HEARTBEAT")[-1].custom_mode, link.of("HEARTBEAT")[-1].system_status) == (RTL, 4)
    link.run_until(lambda: not link.pilot.armed, timeout_s=90.0)
    assert math.hypot(*link.position[:2]) < 0.5


# --- 11 the pilot --------------------------------------------------------------------------------------------------------


def test_a_take_over_shows_within_a_fifth_of_a_second_and_setpoints_are_ignored():
    link = Link().flying()
    link.received.clear()
    link.pilot.set_mode(LOITER)
    link.run(0.2)
    assert link.of("HEARTBEAT")[-1].custom_mode == LOITER
    start = link.position
    link.run(3.0, each_tick=lambda: link.setpoint(POSITION, (5, 0, -3)))
    assert link.distance_to(start) < 0.15
    assert link.command(176, 1, GUIDED) == ACCEPTED, "the autopilot itself lets a companion take over again"


def test_the_yaw_stick_overrides_the_setpoints_yaw_until_it_is_centred():
    link = Link().flying()
    hold = (0, 0, -3)
    link.pilot.yaw_stick(-0.5)
    link.run(2.0, each_tick=lambda: link.setpoint(POSITION_YAW, hold, yaw=math.radians(90)))
    assert yaw_ned_deg(link) > 120.0
    link.pilot.yaw_stick(0.0)
    link.run(5.0, each_tick=lambda: link.setpoint(POSITION_YAW, hold, yaw=math.radians(90)))
    assert yaw_ned_deg(link) == pytest.approx(90.0, abs=3.0)


@pytest.mark.parametrize("height_m", [3.0, 8.0])
def test_a_take_over_without_a_remote_control_sinks_in_loiter_and_lands(height_m):
    link = Link().flying(height_m)
    link.pilot.throttle_stick(-1.0)
    link.run(2.0)
    assert link.position[2] == pytest.approx(height_m, abs=0.2), "in GUIDED the sticks do nothing"
    link.pilot.set_mode(LOITER)
    link.run(1.5)
    assert link.vehicle.body.velocity[2] < -0.5
    link.run_until(lambda: link.landed_state == GROUND, timeout_s=10.0)
    assert link.pilot.armed
    link.run_until(lambda: not link.pilot.armed, timeout_s=11.0)


def test_a_take_over_without_a_remote_control_falls_in_stabilize():
    link = Link().flying()
    link.pilot.throttle_stick(-1.0)
    link.pilot.set_mode(STABILIZE)
    link.run_until(lambda: link.landed_state == GROUND, timeout_s=1.0)
    assert link.position[2] == 0.0
    assert link.pilot.armed
    link.run_until(lambda: not link.pilot.armed, timeout_s=11.0)


def test_a_throttle_that_holds_keeps_the_height_in_stabilize():
    link = Link().flying()
    link.pilot.throttle_stick(0.1)
    link.pilot.set_mode(STABILIZE)
    link.run(5.0)
    assert link.position[2] == pytest.approx(3.0, abs=0.2)


# --- a ground station's sticks: MANUAL_CONTROL -----------------------------------------------------------------------------


def sticks(link, *, system=255, target=1, x=0, y=0, z=500, r=0):
    sender = mavlink.MAVLink(None, srcSystem=system, srcComponent=190)
    link.endpoint.feed(mavlink.MAVLink_manual_control_message(target, x, y, z, r, 0).pack(sender))


def heading_rad(link):
    return math.radians(90.0 - yaw_ned_deg(link))


def test_in_guided_the_sticks_do_nothing_but_turn_the_nose():
    link = Link().flying()
    start = link.position
    link.run(3.0, each_tick=lambda: sticks(link, x=1000, y=-1000, z=1000))
    assert (link.pilot.mode, link.distance_to(start) < 0.15) == (GUIDED, True)
    before_deg = yaw_ned_deg(link)
    link.run(1.0, each_tick=lambda: sticks(link, r=200))
    assert (yaw_ned_deg(link) - before_deg) % 360.0 == pytest.approx(30.0, abs=15.0), "clockwise"


@pytest.mark.parametrize(("axis", "ahead", "right", "up"), [("x", 1, 0, 0), ("y", 0, 1, 0), ("z", 0, 0, 1)])
def test_in_loiter_the_sticks_fly_and_centred_ones_hold(axis, ahead, right, up):
    link = Link(params={"LOIT_SPEED": 300.0}).flying()
    link.pilot.set_mode(LOITER)
    (x0, y0, z0), yaw = link.position, heading_rad(link)
    link.run(4.0, each_tick=lambda: sticks(link, **{axis: 1000}))
    x, y, z = link.position
    gone = ((x - x0) * math.cos(yaw) + (y - y0) * math.sin(yaw), (x - x0) * math.sin(yaw) - (y - y0) * math.cos(yaw), z - z0)
    for part, wanted in zip(gone, (ahead, right, up), strict=True):
        assert part > 4.0 if wanted else abs(part) < 0.3
    link.run(4.0, each_tick=lambda: sticks(link))
    held = link.position
    link.run(3.0, each_tick=lambda: sticks(link))
    assert link.distance_to(held) < 0.15


def test_sticks_that_are_not_heard_of_any_more_fly_nothing():
    link = Link(params={"LOIT_SPEED": 300.0, "RC_OVERRIDE_TIME": 0.5}).flying()
    link.pilot.set_mode(LOITER)
    link.run(2.0, each_tick=lambda: sticks(link, x=1000))
    link.run(0.5)
    left = link.position
    link.run(10.0)
    assert link.distance_to(left) < 4.0, "the way that it needs to stop"
    held = link.position
    link.run(3.0)
    assert link.distance_to(held) < 0.15


@pytest.mark.parametrize("wrong", [{"system": 254}, {"target": 2}, {"x": 0x7FFF, "y": 0x7FFF, "z": 0x7FFF, "r": 0x7FFF}])
def test_sticks_of_others_and_axes_that_are_not_there_fly_nothing(wrong):
    link = Link().flying()
    link.pilot.set_mode(LOITER)
    start = link.position
    link.run(3.0, each_tick=lambda: sticks(link, **{"x": 1000, **wrong}))
    assert link.distance_to(start) < 0.15
