"""The small parts: commands, texts, stamps, streams, stillness, settings, what messages say of the vehicle."""

import math
from dataclasses import fields
from threading import Thread

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from perception_core import SettingsError
from perception_core.ros.settings import override
from perception_core.tunable import check_ranges, ranges
from uav_guidance.commands import ATTEMPTS, Outcome, Procedure, arm, set_mode, take_off
from uav_guidance.encoding import from_autopilot_to_us
from uav_guidance.settings import GuidanceSettings
from uav_guidance.stamping import PERIOD_NS, Alarm, FineClock, StampClock, Steps
from uav_guidance.stillness import StillWatch
from uav_guidance.streams import STREAMS_HZ, StreamKeeper
from uav_guidance.texts import TextAssembler
from uav_guidance.vectors import Vec3
from uav_guidance.vehicle import Landed, Mode, VehicleSnapshot, mode_name, updated

# ---- commands


def test_procedure_sends_each_command_once_when_it_is_answered():
    procedure = Procedure([set_mode(Mode.GUIDED), arm(), take_off(3.0)])
    sent = []
    for step in range(10):
        command = procedure.due(step * 0.05)
        if command is not None:
            sent.append((command.number, command.parameters[0], command.parameters[1], command.parameters[6], command.confirmation))
            procedure.on_answer(command.number, 0, step * 0.05)
    assert sent == [(176, 1.0, 4.0, 0.0, 0), (400, 1.0, 0.0, 0.0, 0), (22, 0.0, 0.0, 3.0, 0)]
    assert procedure.outcome is not None
    assert procedure.outcome.accepted


def test_unanswered_command_is_repeated_with_its_count_then_given_up():
    procedure = Procedure([arm()])
    sent = [command.confirmation for step in range(120) if (command := procedure.due(step * 0.05)) is not None]
    assert sent == list(range(ATTEMPTS))
    assert procedure.outcome is not None
    assert (procedure.outcome.accepted, procedure.outcome.answered) == (False, False)


def test_command_in_progress_is_waited_for():
    procedure = Procedure([arm()])
    assert procedure.due(0.0) is not None
    procedure.on_answer(400, 5, 0.9)
    assert procedure.due(1.5) is None
    procedure.on_answer(400, 0, 1.6)
    assert procedure.outcome is not None


def test_answers_to_other_commands_and_before_sending_are_not_meant():
    procedure = Procedure([arm()])
    procedure.on_answer(400, 0, 0.0)
    procedure.due(0.0)
    procedure.on_answer(511, 4, 0.0)
    assert procedure.outcome is None


@pytest.mark.parametrize("late", [False, True])
def test_refusal_carries_the_texts_before_and_shortly_after_the_answer(late):
    procedure = Procedure([arm()])
    procedure.on_text(2, "said before")
    procedure.due(0.0)
    if not late:
        procedure.on_text(2, "Arm: GPS 1")
    procedure.on_answer(400, 4, 0.1)
    assert procedure.due(0.2) is None
    if late:
        procedure.on_text(2, "Arm: GPS 1")
    procedure.on_text(6, "only an info")
    procedure.on_text(2, "Arm: Battery")
    procedure.on_text(2, "Arm: Battery")
    assert procedure.due(0.6) is None
    assert procedure.outcome is not None
    assert procedure.outcome.reason == "arm failed: Arm: GPS 1; Arm: Battery"
    assert procedure.outcome.answered


def test_the_reason_is_waited_for_in_the_autopilots_own_time():
    """The mission clock may run ahead of what is read of the link."""
    procedure = Procedure([arm()])
    assert procedure.due(1.0) is not None
    procedure.on_vehicle("LOCAL_POSITION_NED", VehicleSnapshot(boot_ms=50_000))
    procedure.on_answer(400, 4, 1.1)
    assert procedure.due(1.9) is None
    assert procedure.outcome is None, "the autopilot's next 0.4 s were not heard yet"
    procedure.on_text(2, "Arm: Compass not calibrated")
    procedure.on_vehicle("LOCAL_POSITION_NED", VehicleSnapshot(boot_ms=50_400))
    procedure.due(1.9)
    assert procedure.outcome == Outcome(accepted=False, reason="arm failed: Arm: Compass not calibrated")
    silent = Procedure([arm()])
    silent.due(1.0)
    silent.on_vehicle("LOCAL_POSITION_NED", VehicleSnapshot(boot_ms=50_000))
    silent.on_answer(400, 4, 1.1)
    silent.due(3.2)
    assert silent.outcome == Outcome(accepted=False, reason="arm failed")


def test_text_chunks_are_put_together():
    assembler = TextAssembler()
    assert assembler.take("short", 0, 0) == "short"
    assert assembler.take("x" * 50, 7, 0) is None
    assert assembler.take("end", 7, 1) == "x" * 50 + "end"
    assert assembler.take("y" * 50, 8, 0) is None
    assert assembler.take("lost one", 8, 2) is None
    assert assembler.take("z" * 50, 9, 0) is None
    assert assembler.take("", 9, 1) == "z" * 50


# ---- time


@given(st.lists(st.integers(-19, 30), min_size=60, max_size=120), st.integers(0, 10**6))
def test_stamps_grow_and_follow_the_time_of_measurement(delays_ms, boot_offset_ms):
    clock = StampClock()
    last_ns = 0
    for index, delay_ms in enumerate(delays_ms):
        measured_ms = 100_000 + index * 20
        stamp_ns = clock.stamp_ns(measured_ms - 100_000 + boot_offset_ms, (measured_ms + delay_ms) * 10**6)
        if stamp_ns is not None:
            assert stamp_ns > last_ns
            assert -19e6 <= stamp_ns - measured_ms * 1e6 <= 30e6
            last_ns = stamp_ns


def test_rare_delays_leave_the_stamps_exact():
    clock = StampClock()
    stamps = [clock.stamp_ns(i * 20, 10**9 + i * 20 * 10**6 + (15 * 10**6 if i % 3 == 2 else 0)) for i in range(100)]
    assert stamps == [10**9 + i * 20 * 10**6 for i in range(100)]


def test_a_stall_of_a_second_leaves_the_stamps_exact():
    clock = StampClock()
    for i in range(200):
        assert clock.stamp_ns(i * 20, i * 20_000_000) in {i * 20_000_000, None}
    for i in range(200, 250):
        assert clock.stamp_ns(i * 20, i * 20_000_000 - 220_000_000) == i * 20_000_000


def test_a_clock_that_is_set_is_followed_at_once():
    clock = StampClock()
    for i in range(30):
        clock.stamp_ns(i * 20, i * 20 * 10**6)
    assert clock.stamp_ns(600, 50 * 10**9) == 50 * 10**9
    assert clock.stamp_ns(20, 51 * 10**9) == 51 * 10**9  # the autopilot restarted


@pytest.mark.parametrize("rate", [0.3, 1.0, 4.0])
def test_a_coarse_clock_is_read_between_its_steps(rate):
    clock = FineClock()
    assert clock.now_ns(0) is None
    for step in range(50):
        clock.tick(step * 20_000_000, int(step * 20_000_000 / rate))
    begin = int(49 * 20_000_000 / rate)
    assert clock.now_ns(begin) == 980_000_000
    assert clock.now_ns(begin + int(10_000_000 / rate)) == pytest.approx(990_000_000, abs=100)
    assert clock.now_ns(begin + 10**10) == 1_000_000_000  # held: it stands before its next step
    clock.tick(20_000_000, begin + 10**10)
    assert clock.now_ns(begin + 10**10 + 10**6) == 20_000_000  # set back: nothing is known of its steps yet


def test_streams_are_asked_for_on_each_link_and_when_they_stay_away():
    keeper = StreamKeeper()
    assert set(keeper.due(10.0)) == set(STREAMS_HZ)
    assert keeper.due(10.1) == []
    for number in STREAMS_HZ:
        keeper.hear(number, 12.0)
    keeper.hear(mavlink.MAVLINK_MSG_ID_ATTITUDE, 14.0)
    assert set(keeper.due(14.6)) == set(STREAMS_HZ) - {mavlink.MAVLINK_MSG_ID_ATTITUDE}
    keeper.forget()
    assert set(keeper.due(14.7)) == set(STREAMS_HZ)


# ---- stillness


def test_still_counts_from_the_last_progress():
    watch = StillWatch(reached_m=0.1, reached_rad=0.035)
    watch.restart(0.0)
    assert watch.step(distance_m=5.0, heading_error_rad=0.0, now_s=1.0) == 0.0
    assert watch.step(distance_m=4.95, heading_error_rad=0.0, now_s=2.0) == 1.0
    assert watch.step(distance_m=4.89, heading_error_rad=0.0, now_s=3.0) == 0.0
    assert watch.step(distance_m=6.0, heading_error_rad=0.0, now_s=4.0) == 1.0
    assert watch.step(distance_m=5.0, heading_error_rad=0.0, now_s=9.0) == 6.0


def test_turning_is_progress():
    watch = StillWatch(reached_m=0.1, reached_rad=0.035)
    watch.restart(0.0)
    for step in range(20):
        assert watch.step(distance_m=5.0, heading_error_rad=1.0 - 0.04 * step, now_s=float(step)) == 0.0


def test_a_vehicle_that_has_arrived_is_not_still_until_pushed_away():
    watch = StillWatch(reached_m=0.1, reached_rad=0.035)
    watch.restart(0.0)
    watch.step(distance_m=0.05, heading_error_rad=0.01, now_s=0.0)
    assert watch.step(distance_m=0.4, heading_error_rad=0.1, now_s=10.0) == 0.0
    assert watch.step(distance_m=0.6, heading_error_rad=0.0, now_s=11.0) == 1.0


# ---- settings


def test_parameters_override_defaults_and_integers_will_do():
    settings = override(GuidanceSettings(), {"url": "udpin:127.0.0.1:14550", "fence_radius_m": 30})
    assert (settings.url, settings.fence_radius_m, settings.fence_height_m) == ("udpin:127.0.0.1:14550", 30.0, 20.0)


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"fence_radius": 30.0}, "unknown parameter ~fence_radius; known: baud"),
        ({"fence_radius_m": "30"}, "~fence_radius_m is '30', expected a float like 60.0"),
        ({"baud": True}, "~baud is True"),
        ({"max_speed_m_s": 3.1}, "~max_speed_m_s is 3.1, expected 0.1 to 3"),
        ({"link_lost_s": math.nan}, "~link_lost_s is nan, expected 0.5 to 30"),
    ],
)
def test_wrong_parameters_are_named(parameters, words):
    with pytest.raises(SettingsError) as caught:
        override(GuidanceSettings(), parameters)
    assert words in str(caught.value)


def test_every_number_but_the_baud_rate_may_be_changed_in_flight_and_the_defaults_are_in_range():
    check_ranges(GuidanceSettings())
    assert {field.name for field in fields(GuidanceSettings)} - ranges(GuidanceSettings).keys() == {"url", "baud"}


# ---- the vehicle


def heard(*messages):
    vehicle = VehicleSnapshot()
    for message in messages:
        vehicle = updated(vehicle, message, 12.5)
    return vehicle


def test_heartbeat_tells_mode_and_arming():
    vehicle = heard(mavlink.MAVLink_heartbeat_message(13, 3, 128 + 81, 4, 4, 3))
    assert (vehicle.heartbeat_s, vehicle.mode, vehicle.armed) == (12.5, Mode.GUIDED, True)


@pytest.mark.parametrize("mode", list(Mode))
def test_every_mode_has_a_name(mode):
    assert mode_name(int(mode)) == mode.name
    assert mode_name(99) == "99"
    assert mode_name(None) == ""


@pytest.mark.parametrize(("health", "ready"), [(0x10000000, True), (0x0FFFFFFF, False), (0x1FFFFFFF, True)])
def test_ready_is_the_prearm_bit(health, ready):
    assert heard(mavlink.MAVLink_sys_status_message(0, 0, health, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0)).ready is ready


@pytest.mark.parametrize("state", list(Landed))
def test_landed_states(state):
    vehicle = heard(mavlink.MAVLink_extended_sys_state_message(0, int(state)))
    assert vehicle.landed is state
    assert vehicle.off_ground is (state in {Landed.IN_AIR, Landed.TAKING_OFF, Landed.LANDING})


def test_position_and_attitude_in_map():
    vehicle = heard(
        mavlink.MAVLink_local_position_ned_message(1000, 1.0, 2.0, -3.0, 0.1, 0.2, -0.3),
        mavlink.MAVLink_attitude_message(1010, 0.0, 0.0, 0.0, 0.1, 0.2, 0.3),
    )
    assert vehicle.position_enu_m == Vec3(2.0, 1.0, 3.0)
    assert vehicle.velocity_enu_m_s == Vec3(0.2, 0.1, 0.3)
    assert vehicle.yaw_rad == pytest.approx(math.pi / 2)
    assert vehicle.rates_flu_rad_s == Vec3(0.1, -0.2, -0.3)
    assert vehicle.located


def test_home_from_the_global_origin_or_from_its_local_fields():
    place = (473977418, 85455939, 488000)
    home = mavlink.MAVLink_home_position_message(473977418 + 1000, 85455939, 489000, 4.0, 3.0, -2.0, [1.0, 0, 0, 0], 0, 0, 0)
    assert heard(home).home_enu_m == Vec3(3.0, 4.0, 2.0)
    both = heard(home, mavlink.MAVLink_gps_global_origin_message(*place)).home_enu_m
    assert both.y == pytest.approx(11.13, abs=0.01)
    assert both.z == pytest.approx(1.0)
    assert heard().home_enu_m is None


def test_an_autopilot_that_restarted_is_known_again():
    vehicle = heard(
        mavlink.MAVLink_extended_sys_state_message(0, 2),
        mavlink.MAVLink_local_position_ned_message(90_000, 1.0, 2.0, -3.0, 0, 0, 0),
        mavlink.MAVLink_local_position_ned_message(500, 0.0, 0.0, 0.0, 0, 0, 0),
    )
    assert vehicle.landed is Landed.UNDEFINED
    assert vehicle.position_enu_m == Vec3()


@pytest.mark.parametrize(
    ("source", "target", "ours"),
    [((1, 1), (0, 0), True), ((1, 1), (1, 191), True), ((1, 1), (255, 190), False), ((255, 190), (1, 191), False)],
)
def test_only_the_autopilots_own_answers_to_us_are_heard(source, target, ours):
    sender, receiver = mavlink.MAVLink(None, *source), mavlink.MAVLink(None, 1, 191)
    frame = mavlink.MAVLink_command_ack_message(400, 0, 0, 0, *target).pack(sender)
    assert from_autopilot_to_us(receiver.parse_buffer(frame)[0]) is ours


def test_forwarded_heartbeats_are_not_the_autopilots():
    sender, receiver = mavlink.MAVLink(None, 255, 190), mavlink.MAVLink(None, 1, 191)
    frame = mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3).pack(sender)
    assert not from_autopilot_to_us(receiver.parse_buffer(frame)[0])


@pytest.mark.parametrize("last", [100, 120, 10], ids=["at its moment", "behind it", "set back"])
def test_an_alarm_wakes_at_its_moment_and_where_the_clock_is_set_back(last):
    alarm, woken, wakes = Alarm(), [], []
    alarm._ticked.notify = lambda notify=alarm._ticked.notify: (wakes.append(alarm._now_ns), notify())
    alarm.tick(0)
    assert not alarm.wait(100, 0.0)
    sleeper = Thread(target=lambda: woken.append(alarm.wait(100, 60.0)))
    sleeper.start()
    for tick in (20, 40, 60):
        alarm.tick(tick)
    assert woken == []
    assert wakes == [0]  # when nobody had set it yet
    alarm.tick(last)
    sleeper.join(60.0)
    assert woken == [True]
    assert wakes == [0, last]
    assert alarm.wait(last, 60.0)  # it has passed
    assert not alarm.wait(1000, 0.0)


TICK_NS = 20_000_000


@given(
    st.integers(0, 10**9),
    st.sampled_from([1.0, 1.2, 3.0, 6.0]),
    st.lists(st.integers(0, 12), min_size=1, max_size=30),
)
def test_a_clock_that_waits_for_steps_never_waits_for_steps_that_wait_for_it(begin_ns, lag, held_up):
    """``lag``: periods by which the clock may be ahead of what is done; ``held_up``: ticks that a step takes, where the clock goes on."""
    steps = Steps(begin_ns)
    now_ns = done_ns = begin_ns

    def may_advance() -> bool:
        return now_ns - done_ns <= lag * PERIOD_NS

    for ticks in held_up:
        while now_ns < steps.due_ns:
            assert may_advance(), f"it stands at {now_ns}, the next step is due at {steps.due_ns}"
            now_ns += TICK_NS
        for _ in range(ticks):
            now_ns += TICK_NS * may_advance()
        if steps.made(now_ns):
            done_ns = now_ns
        assert now_ns - PERIOD_NS < steps.due_ns <= now_ns + PERIOD_NS


def test_steps_follow_a_clock_that_is_set_back():
    steps = Steps(10 * PERIOD_NS)
    assert steps.made(10 * PERIOD_NS)
    assert steps.made(2 * PERIOD_NS)
    assert steps.due_ns == 3 * PERIOD_NS
