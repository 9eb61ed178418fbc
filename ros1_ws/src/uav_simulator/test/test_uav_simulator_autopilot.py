"""The autopilot as a MAVLink client sees it, by the numbers of the behaviours measured on ArduCopter: link, modes, arming, home."""

import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from uav_simulator_link import (
    ACCEPTED,
    BRAKE,
    DENIED,
    FAILED,
    GUIDED,
    LAND,
    LOITER,
    POSITION,
    POSITION_YAW,
    RTL,
    UNSUPPORTED,
    Link,
)

# --- 1 streams -----------------------------------------------------------------------------------------------------------


def test_a_fresh_link_carries_only_heartbeats_and_timesync():
    link = Link()
    link.run(12.0)
    assert {m.get_type() for _, m in link.received} == {"HEARTBEAT", "TIMESYNC"}
    assert 11 <= len(link.of("HEARTBEAT")) <= 13


def test_a_message_comes_at_the_interval_asked_for_and_stops_when_asked():
    link = Link()
    link.ask(32, hz=10)
    link.received.clear()
    link.run(2.0)
    assert 19 <= len(link.of("LOCAL_POSITION_NED")) <= 21
    assert link.command(511, 32, -1) == ACCEPTED
    link.run(1.0)
    assert not link.of("LOCAL_POSITION_NED")


@pytest.mark.parametrize("message_id", [1, 2, 30, 31, 32, 33, 49, 85, 147, 242, 245])
def test_every_message_can_be_asked_for(message_id):
    link = Link()
    link.ask(message_id, hz=50)
    link.received.clear()
    link.run(0.2)
    assert len([m for _, m in link.received if m.get_msgId() == message_id]) >= 9
    assert link.command(510, message_id) == ACCEPTED
    assert link.of("MESSAGE_INTERVAL")[0].interval_us == 20000


def test_an_unknown_message_is_denied():
    assert Link().command(511, 11000, 100000) == DENIED


def test_request_data_stream_resets_intervals_and_never_brings_three_messages():
    link = Link()
    link.ask(245, 85, 32)
    link.send(mavlink.MAVLink_request_data_stream_message(1, 1, mavlink.MAV_DATA_STREAM_ALL, 5, 1))
    link.received.clear()
    link.run(2.0)
    kinds = {m.get_type() for _, m in link.received}
    assert {"LOCAL_POSITION_NED", "ATTITUDE", "SYS_STATUS", "GLOBAL_POSITION_INT"} <= kinds
    assert not kinds & {"EXTENDED_SYS_STATE", "HOME_POSITION", "POSITION_TARGET_LOCAL_NED"}
    assert 9 <= len(link.of("LOCAL_POSITION_NED")) <= 11


def test_a_client_that_comes_back_finds_a_fresh_link():
    link = Link()
    link.ask(32)
    link.endpoint.open_link()
    link.run(1.0)
    link.received.clear()
    link.run(1.0)
    assert not link.of("LOCAL_POSITION_NED")


def test_origin_and_home_are_told_when_they_are_set():
    link = Link(boot_before_s=0.0)
    link.run(41.5)
    assert not link.of("GPS_GLOBAL_ORIGIN")
    assert not link.of("HOME_POSITION")
    link.run(1.0)
    assert len(link.of("GPS_GLOBAL_ORIGIN")) == 1
    assert len(link.of("HOME_POSITION")) == 1


# --- 2 heartbeats --------------------------------------------------------------------------------------------------------


def test_the_ground_stations_heartbeats_are_forwarded():
    link = Link()
    link.run(3.0)
    assert {(m.get_srcSystem(), m.get_srcComponent()) for _, m in link.received if m.get_type() == "HEARTBEAT"} == {(1, 1), (255, 190)}
    mine, theirs = link.of("HEARTBEAT")[0], link.of("HEARTBEAT", system=255)[0]
    assert (mine.type, mine.autopilot) == (mavlink.MAV_TYPE_HEXAROTOR, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA)
    assert theirs.type == mavlink.MAV_TYPE_GCS


def test_what_is_for_another_system_is_left_alone():
    link = Link()
    link.send(mavlink.MAVLink_command_long_message(2, 1, 176, 0, 1, GUIDED, 0, 0, 0, 0, 0))
    assert not link.of("COMMAND_ACK")
    assert link.pilot.mode == 0


# --- 3 modes -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("mode", [0, GUIDED, LOITER, RTL, LAND, BRAKE])
def test_a_mode_can_be_set_and_the_heartbeat_tells_it_at_once(mode):
    link = Link()
    link.command(176, 1, LOITER if mode == 0 else 0)
    assert link.command(176, 1, mode) == ACCEPTED
    link.run(0.2)
    assert link.of("HEARTBEAT")[-1].custom_mode == mode


def test_wrong_mode_commands_are_refused():
    link = Link()
    assert link.command(176, 0, GUIDED) == DENIED
    assert link.command(176, 1, 77) == FAILED
    assert link.texts()
    assert link.pilot.mode == 0


def test_the_old_set_mode_works_without_an_acknowledgement():
    link = Link()
    link.send(mavlink.MAVLink_set_mode_message(1, 1, GUIDED))
    assert link.pilot.mode == GUIDED
    assert not link.of("COMMAND_ACK")


def test_an_unknown_command_is_unsupported():
    assert Link().command(31000) == UNSUPPORTED


# --- 4 arming ------------------------------------------------------------------------------------------------------------


def healthy(link):
    link.run(0.5)
    return bool(link.of("SYS_STATUS")[-1].onboard_control_sensors_health & 0x10000000)


def test_before_it_has_a_position_arming_fails_with_a_reason_and_guided_is_accepted():
    link = Link(boot_before_s=3.0)
    link.ask(1, 32, hz=4)
    assert link.command(176, 1, GUIDED) == ACCEPTED
    assert not healthy(link)
    assert link.command(400, 1) == FAILED
    assert any(t.startswith("Arm: ") for t in link.texts())
    link.run(37.5)
    assert not healthy(link)
    assert not link.of("LOCAL_POSITION_NED")
    assert "PreArm: Need Position Estimate" in link.texts()
    assert link.command(400, 1) == FAILED
    assert link.texts() == ["Arm: Need Position Estimate"]
    link.run(0.5)
    assert healthy(link)
    assert link.of("LOCAL_POSITION_NED")
    assert link.command(400, 1) == ACCEPTED


def test_without_the_need_of_a_position_it_is_ready_earlier_and_falls_back_in_guided():
    link = Link(boot_before_s=22.0)
    link.ask(1, hz=4)
    assert not healthy(link)
    link.run(0.5)
    assert healthy(link), "in STABILIZE, 23 s after power-up"
    assert link.command(176, 1, GUIDED) == ACCEPTED
    assert not healthy(link)
    link.command(176, 1, 0)
    assert healthy(link)


def test_guided_right_after_power_up_falls_back():
    link = Link(boot_before_s=0.5)
    assert link.command(176, 1, GUIDED) == ACCEPTED
    assert link.run_until(lambda: link.pilot.mode == 0, timeout_s=3.0) == pytest.approx(1.4, abs=0.05)
    assert link.command(176, 1, GUIDED) == ACCEPTED
    link.run(0.1)
    link = Link(boot_before_s=2.1)
    link.command(176, 1, GUIDED)
    link.run(3.0)
    assert link.pilot.mode == GUIDED


def test_on_the_ground_it_disarms_itself_ten_seconds_after_arming():
    link = Link().guided_and_armed()
    assert link.run_until(lambda: not link.pilot.armed, timeout_s=12.0) == pytest.approx(10.0, abs=0.1)
    link.run(0.1)
    assert not link.of("HEARTBEAT")[-1].base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED


def test_disarming_in_the_air_fails_without_force():
    link = Link().flying()
    assert link.command(400, 0) == FAILED
    assert link.texts()
    assert link.pilot.armed
    assert link.command(400, 0, 21196) == ACCEPTED
    link.run(3.0)
    assert link.position[2] == 0.0


@pytest.mark.parametrize("mode", [RTL, LAND])
def test_some_modes_are_not_armable(mode):
    link = Link()
    link.command(176, 1, mode)
    assert link.command(400, 1) == FAILED
    assert any(t.startswith("Arm: ") for t in link.texts())


# --- 9 home --------------------------------------------------------------------------------------------------------------


def test_home_is_reset_at_every_arming_and_the_origin_stays():
    link = Link().flying()
    link.setpoint(POSITION, (0, 6, -3))
    link.run(8.0)
    link.command(21)
    link.run_until(lambda: not link.pilot.armed, timeout_s=15.0)
    link.command(176, 1, GUIDED)
    link.received.clear()
    link.command(400, 1)
    home = link.of("HOME_POSITION")[0]
    assert (home.x, home.y) == pytest.approx((0.0, 6.0), abs=0.15)
    assert link.pilot.estimate.position[0] == pytest.approx(6.0, abs=0.15), "the local position still counts from the origin"
    assert home.longitude - 14740000 == pytest.approx(6.0 / (6378137 * math.cos(math.radians(43.566))) * 180 / math.pi * 1e7, abs=30)


@pytest.mark.parametrize("ask", [(410,), (512, 242)])
def test_home_can_be_asked_for(ask):
    link = Link()
    assert link.command(*ask) == ACCEPTED
    assert len(link.of("HOME_POSITION")) == 1
    assert Link(boot_before_s=0.0).command(*ask) == FAILED, "there is none before the autopilot is ready"


# --- the rest of the link ------------------------------------------------------------------------------------------------


def test_parameters_can_be_read_listed_and_set():
    link = Link()
    link.send(mavlink.MAVLink_param_request_read_message(1, 1, b"WPNAV_SPEED", -1))
    assert link.of("PARAM_VALUE")[0].param_value == 500.0
    link.received.clear()
    link.send(mavlink.MAVLink_param_request_list_message(1, 1))
    values = link.of("PARAM_VALUE")
    assert len(values) == values[0].param_count == len({v.param_id for v in values})


def test_timesync_is_answered_with_the_time_since_power_up():
    link = Link()
    link.run(1.0)
    link.send(mavlink.MAVLink_timesync_message(0, 1234))
    answer = link.of("TIMESYNC")[-1]
    assert (answer.ts1, answer.tc1) == (1234, 61_000_000_000)


def test_garbage_on_the_link_does_no_harm():
    link = Link()
    link.endpoint.feed(b"\xfd\x09\x00garbage\xfe\x00" * 20 + bytes(300))  # zeros fill whatever frame the noise seemed to begin
    assert link.command(176, 1, GUIDED) == ACCEPTED


def test_the_estimate_stays_within_three_centimetres_and_is_not_perfect():
    link = Link().flying()
    errors = []
    link.run(30.0, each_tick=lambda: errors.append(math.dist(link.pilot.estimate.position, link.position)))
    assert 0.002 < max(errors) <= 0.03 + 0.001


def test_ned_of_the_messages_is_the_vehicles():
    link = Link().flying()
    link.ask(30, 31, 32, 33)
    link.setpoint(POSITION_YAW, (4, 7, -3), yaw=math.radians(30))
    link.run(10.0)
    local, attitude, quat = link.of("LOCAL_POSITION_NED")[-1], link.of("ATTITUDE")[-1], link.of("ATTITUDE_QUATERNION")[-1]
    assert (local.x, local.y, local.z) == pytest.approx((4, 7, -3), abs=0.15)
    assert math.degrees(attitude.yaw) == pytest.approx(30.0, abs=2.0)
    w, x, y, z = quat.q1, quat.q2, quat.q3, quat.q4
    assert math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)) == pytest.approx(attitude.yaw, abs=1e-3)
    assert math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)) == pytest.approx(attitude.roll, abs=1e-3)
    assert math.asin(2 * (w * y - z * x)) == pytest.approx(attitude.pitch, abs=1e-3)
    globe = link.of("GLOBAL_POSITION_INT")[-1]
    assert globe.relative_alt == pytest.approx(3000, abs=100)
    assert globe.hdg == pytest.approx(3000, abs=200)
