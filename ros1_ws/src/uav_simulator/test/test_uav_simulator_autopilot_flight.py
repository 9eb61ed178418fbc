"""The autopilot in flight, by the numbers of the behaviours measured on ArduCopter: take-off, setpoints, yaw, landing."""

import math

import pytest
from uav_simulator_link import (
    ACCEPTED,
    FAILED,
    GROUND,
    IN_AIR,
    LAND,
    LANDING,
    POSITION,
    POSITION_YAW,
    TAKING_OFF,
    VELOCITY,
    Link,
    yaw_ned_deg,
)

NAN = math.nan


# --- 5 take-off ----------------------------------------------------------------------------------------------------------


def test_a_take_off_spools_up_lifts_off_and_reaches_its_height():
    link = Link().guided_and_armed()
    assert link.command(22, 0, 0, 0, 0, 0, 0, 3.0) == ACCEPTED
    spool_s = link.run_until(lambda: link.landed_state == TAKING_OFF, timeout_s=4.0)
    assert spool_s == pytest.approx(2.4, abs=0.05)
    assert link.run_until(lambda: link.landed_state == IN_AIR, timeout_s=5.0) <= 3.5
    link.run(2.0)
    assert link.position[2] == pytest.approx(3.0, abs=0.06)


def test_a_take_off_needs_arming_guided_and_the_ground():
    link = Link()
    assert link.command(22, 0, 0, 0, 0, 0, 0, 3.0) == FAILED
    assert link.texts()
    link.command(400, 1)
    assert link.command(22, 0, 0, 0, 0, 0, 0, 3.0) == FAILED, "armed but in STABILIZE"
    link.flying()
    assert link.command(22, 0, 0, 0, 0, 0, 0, 5.0) == FAILED, "already in the air"


def test_setpoints_alone_do_not_lift_off():
    link = Link().guided_and_armed()
    link.run(5.0, each_tick=lambda: link.setpoint(POSITION, (0, 0, -3)))
    assert link.position[2] == 0.0
    assert link.landed_state == GROUND


def test_a_setpoint_before_lift_off_cancels_the_take_off_silently():
    link = Link().guided_and_armed()
    link.command(22, 0, 0, 0, 0, 0, 0, 3.0)
    link.run(1.0)
    link.received.clear()
    link.setpoint(POSITION, (0, 0, -3))
    assert not link.received
    link.run(5.0)
    assert link.landed_state == GROUND
    assert link.position[2] == 0.0


def test_a_setpoint_during_the_climb_ends_it_and_is_flown_to():
    link = Link().guided_and_armed()
    link.command(22, 0, 0, 0, 0, 0, 0, 10.0)
    link.run(4.0)
    link.setpoint(POSITION, (3, 0, -4))
    assert link.landed_state == IN_AIR
    link.run(8.0)
    assert link.distance_to((0, 3, 4)) < 0.15


# --- 6 setpoints ---------------------------------------------------------------------------------------------------------

FOLLOWED_POSITION = [0x0DF8, 0x09F8, 0x05F8, 0x01F8, 0x0000, 0x09C0, 0x01C0, 0x0FF8]
FOLLOWED_VELOCITY = [0x0DC7, 0x09C7, 0x05C7]
NOT_FOLLOWED = [0x0DFC, 0x0FFF, 0x09FF, 0x0C38]


@pytest.mark.parametrize("mask", FOLLOWED_POSITION, ids=hex)
def test_position_masks_are_followed(mask):
    link = Link().flying()
    link.setpoint(mask, (2, 1, -3.5))
    link.run(6.0)
    assert link.distance_to((1, 2, 3.5)) < 0.15


@pytest.mark.parametrize("mask", FOLLOWED_VELOCITY, ids=hex)
def test_velocity_masks_are_followed(mask):
    link = Link().flying()
    link.run(3.0, each_tick=lambda: link.setpoint(mask, velocity_ned=(0.5, 1.0, -0.2)))
    assert link.vehicle.body.velocity == pytest.approx((1.0, 0.5, 0.2), abs=0.08)


@pytest.mark.parametrize("mask", NOT_FOLLOWED, ids=hex)
def test_other_masks_are_not_followed_without_a_word(mask):
    link = Link().flying()
    start = link.position
    link.received.clear()
    link.run(3.0, each_tick=lambda: link.setpoint(mask, (2, 1, -3.5), (0.5, 1.0, -0.2), yaw=2.0))
    assert link.distance_to(start) < 0.1
    assert {m.get_type() for _, m in link.received} <= {"HEARTBEAT", "TIMESYNC"}


def test_nan_in_ignored_fields_is_harmless():
    link = Link().flying()
    link.setpoint(POSITION, (2, 1, -3.5), (NAN, NAN, NAN), yaw=NAN, yaw_rate=NAN, accel=(NAN, NAN, NAN))
    link.run(6.0)
    assert link.distance_to((1, 2, 3.5)) < 0.15


def test_a_position_does_not_expire_and_a_velocity_does():
    link = Link().flying()
    link.setpoint(POSITION, (8, 0, -3))
    link.run(10.0)
    assert link.distance_to((0, 8, 3)) < 0.15
    link.setpoint(VELOCITY, velocity_ned=(0, 1, 0))
    link.run(2.9)
    assert link.vehicle.body.velocity[0] == pytest.approx(1.0, abs=0.08)
    link.run(3.0)
    assert math.hypot(*link.vehicle.body.velocity) < 0.08


def test_frame_7_is_an_offset_along_the_worlds_axes():
    link = Link().flying()
    link.setpoint(POSITION, (0, 5, -3))
    link.run(8.0)
    link.setpoint(POSITION, (2, 0, -1), frame=7)
    link.run(6.0)
    assert link.distance_to((5, 2, 4)) < 0.2


def test_frame_8_is_an_offset_along_the_nose():
    link = Link().flying()  # the nose points east
    link.setpoint(POSITION, (2, 1, 0), frame=8)
    link.run(6.0)
    assert link.distance_to((2, -1, 3)) < 0.2


# --- 7 yaw ---------------------------------------------------------------------------------------------------------------


def test_with_both_yaw_bits_ignored_the_nose_turns_along_the_travel():
    link = Link().flying()
    link.setpoint(POSITION, (10, 0, -3))
    link.run(6.0)
    assert abs((yaw_ned_deg(link) + 180.0) % 360.0 - 180.0) < 3.0


def test_a_yaw_in_the_setpoint_is_kept_while_moving_sideways():
    link = Link().flying()
    link.setpoint(POSITION_YAW, (10, 0, -3), yaw=math.radians(90))
    link.run(1.5)
    assert link.vehicle.body.velocity[1] > 0.5
    assert yaw_ned_deg(link) == pytest.approx(90.0, abs=3.0)


def test_condition_yaw_works_until_the_next_setpoint_without_yaw():
    link = Link().flying()
    assert link.command(115, 200, 45, 1, 0) == ACCEPTED
    link.run(6.0)
    assert yaw_ned_deg(link) == pytest.approx(200.0, abs=3.0)
    link.setpoint(POSITION, (10, 0, -3))
    link.run(6.0)
    assert abs((yaw_ned_deg(link) + 180.0) % 360.0 - 180.0) < 3.0


def test_condition_yaw_turns_the_way_it_is_told_and_relatively():
    link = Link().flying()  # heading 90 degrees
    link.command(115, 30, 45, -1, 1)
    link.run(4.0)
    assert yaw_ned_deg(link) == pytest.approx(60.0, abs=3.0)
    link.command(115, 90, 60, -1, 0)  # to the east, but the long way round
    link.run(2.0)
    assert 0.0 <= (60.0 - yaw_ned_deg(link)) % 360.0 <= 180.0
    link.run(8.0)
    assert yaw_ned_deg(link) == pytest.approx(90.0, abs=3.0)
    assert link.command(115, 500) == FAILED


# --- 8 landed state ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("land", [(176, 1, LAND), (21,)])
def test_landing_ends_on_the_ground_and_disarms_half_a_second_later(land):
    link = Link().flying()
    link.ask(245, hz=50)
    assert link.command(*land) == ACCEPTED
    link.run_until(lambda: link.landed_state == GROUND, timeout_s=12.0)
    assert link.pilot.armed
    assert link.run_until(lambda: not link.pilot.armed, timeout_s=2.0) == pytest.approx(0.5, abs=0.05)
    states = [m.landed_state for m in link.of("EXTENDED_SYS_STATE")]
    assert list(dict.fromkeys(states)) == [LANDING, GROUND]


def test_a_landing_from_high_up_is_slow_near_the_ground():
    link = Link().flying(height=16.0)
    link.command(21)
    speeds = []
    link.run_until(
        lambda: link.position[2] == 0.0, timeout_s=40.0, each_tick=lambda: speeds.append((link.position[2], -link.vehicle.body.velocity[2]))
    )
    assert max(v for z, v in speeds if z > 11.0) > 1.3
    assert max(v for z, v in speeds if z < 8.0) < 0.6


def test_a_touch_down_in_guided_stays_armed():
    link = Link().flying()
    link.ask(245, hz=50)
    link.received.clear()
    link.run_until(lambda: link.landed_state == GROUND, timeout_s=20.0, each_tick=lambda: link.setpoint(POSITION, (0, 0, 2)))
    link.run(3.0)
    assert link.pilot.armed
    assert list(dict.fromkeys(m.landed_state for m in link.of("EXTENDED_SYS_STATE"))) == [IN_AIR, GROUND]
