"""Lockstep and parameters, without ROS."""

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st
from uav_simulator_link import Link

from uav_simulator.autopilot.params import parse_parameters
from uav_simulator.autopilot.tcp_link import TcpLink
from uav_simulator.autopilot.types import Mode
from uav_simulator.autopilot.udp_link import UdpLink
from uav_simulator.errors import ConfigError, SimulatorError
from uav_simulator.pacing import Pacer, header_stamp_s
from uav_simulator.pilot_hooks import apply_pilot_word
from uav_simulator.settings import SimulatorSettings, settings_from_params

LIMIT_S, TIMEOUT_S = 0.3, 2.0


def pacer():
    return Pacer(limit_s=LIMIT_S, timeout_s=TIMEOUT_S)


def test_time_waits_for_a_laggard_and_goes_on_when_it_has_caught_up():
    p = pacer()
    assert p.may_advance(100.0, 0.0), "a node that has never spoken is not waited for"
    p.heard("/a", 10.0)
    assert p.may_advance(10.3, 0.0)
    assert not p.may_advance(10.32, 1.0)
    p.heard("/a", 10.1)
    assert p.may_advance(10.32, 1.5)


def test_from_its_beginning_time_waits_for_all():
    p = Pacer(["/a", "/b=0.06", "/c=zed"], limit_s=LIMIT_S, timeout_s=TIMEOUT_S)
    assert p.may_advance(50.0, 0.0), "time has not begun"
    p.heard("/a", 10.04)
    p.begin(10.0)
    assert p.may_advance(10.06, 0.0)
    assert not p.may_advance(10.08, 0.0), "/b has never spoken"
    p.heard("/b", 10.34)
    assert p.may_advance(10.34, 0.1), "/c has no measurement to deal with"
    assert not p.may_advance(10.36, 0.1), "/a spoke before time began, and no more"
    p.heard("/a", 10.36)
    p.heard("/b", 10.36)
    p.measured("zed", 10.3, 10.3)
    assert p.may_advance(10.36, 0.2)
    assert not p.may_advance(10.38, 0.2), "/c has never spoken, and has its first measurement to deal with"


def test_what_is_waited_for_only_at_the_start_holds_nothing_up_once_time_has_begun():
    p = Pacer(["/states=inf"], limit_s=LIMIT_S, timeout_s=TIMEOUT_S)
    p.begin(10.0)
    assert p.may_advance(1e6, 0.0)


def test_time_lets_go_after_its_timeout_until_the_topic_speaks_again():
    p = pacer()
    p.heard("/a", 10.0)
    assert not p.may_advance(11.0, 50.0)
    assert not p.may_advance(11.0, 51.9)
    assert p.may_advance(11.0, 52.0)
    assert p.left_out == ["/a"]
    assert p.may_advance(15.0, 53.0)
    p.heard("/a", 14.9)
    assert p.left_out == []
    assert not p.may_advance(15.3, 54.0)


def test_time_does_not_wait_for_a_topic_that_nothing_publishes_any_more():
    p = pacer()
    p.heard("/a", 10.0)
    assert not p.may_advance(11.0, 50.0)
    p.gone("/a")
    p.gone("/never heard")
    assert p.may_advance(11.0, 50.0)
    assert p.left_out == ["/a"]
    p.heard("/a", 11.0)
    assert not p.may_advance(11.4, 50.1)


def test_a_topic_that_repeats_an_old_stamp_does_not_come_back():
    p = pacer()
    p.heard("/a", 10.0)
    p.may_advance(20.0, 0.0)
    assert p.may_advance(20.0, 3.0)
    p.heard("/a", 10.0)
    p.heard("/a", 0.0)
    assert p.may_advance(20.0, 3.1)


def test_who_says_again_how_far_it_has_come_is_waited_for_as_a_mission_that_waits_for_another_robot():
    p = pacer()
    p.heard("/a", 10.0)
    for wall_s in range(10):
        assert not p.may_advance(11.0, float(wall_s))
        p.heard("/a", 10.0)
    assert not p.may_advance(11.0, 9.0)
    assert p.may_advance(11.0, 9.0 + TIMEOUT_S)


def test_a_node_that_works_on_measurements_is_waited_for_while_there_are_some():
    p = Pacer(["/depth/done=zed", "/state"], limit_s=LIMIT_S, timeout_s=TIMEOUT_S)
    p.measured("zed", 10.0, 10.0)
    p.heard("/depth/done", 10.0)
    assert p.may_advance(99.0, 0.0), "a dead camera does not hold time"
    p.measured("zed", 10.1, 10.1)
    assert p.may_advance(10.16, 0.0), "a measurement is worked on"
    assert not p.may_advance(10.18, 0.0), "but not when the next one is due"
    p.heard("/depth/done", 10.1)
    assert p.may_advance(10.18, 0.1)


def test_time_stops_before_the_measurement_after_the_one_that_is_not_dealt_with():
    p, tick, wall = Pacer(["/depth/done=zed"], limit_s=LIMIT_S, timeout_s=TIMEOUT_S), 0, 0.0
    done = [0]
    p.heard("/depth/done", 0.02)
    for turn in range(400):
        wall += 0.001
        if p.may_advance(tick * 0.02, wall):
            tick += 1
            if tick % 5 == 0:
                p.measured("zed", tick * 0.02, tick * 0.02)
        if turn % 40 == 39 and tick // 5 * 5 > done[-1]:  # 40 ms of wall clock for each
            done.append(done[-1] + 5)
            p.heard("/depth/done", done[-1] * 0.02)
        assert tick * 0.02 - done[-1] * 0.02 <= 0.1 + 0.08 + 1e-9
    assert len(done) == 11


def test_a_late_measurement_is_waited_for_from_its_arrival():
    p = Pacer(["/depth/done=zed"], limit_s=LIMIT_S, timeout_s=TIMEOUT_S)
    p.heard("/depth/done", 9.9)
    p.measured("zed", 10.0, 10.5)
    assert p.may_advance(10.56, 0.0)
    assert not p.may_advance(10.58, 0.0)


def test_the_slowest_of_many_holds():
    p = pacer()
    p.heard("/a", 10.0)
    p.heard("/b", 9.0)
    assert not p.may_advance(10.0, 0.0)
    p.heard("/b", 10.0)
    assert p.may_advance(10.0, 0.1)


@given(st.lists(st.floats(0.001, 0.5), max_size=40))
def test_a_live_topic_is_never_left_behind_by_more_than_the_limit(progress):
    p, now, stamp, wall = pacer(), 1.0, 1.0, 0.0
    p.heard("/a", stamp)
    for step in progress:
        for _ in range(50):
            wall += 0.001
            if p.may_advance(now, wall):
                now += 0.02
        assert now - stamp <= LIMIT_S + 0.02 + 1e-9
        stamp = min(now, stamp + step)
        p.heard("/a", stamp)


def test_header_stamps_are_read_from_the_first_bytes():
    # std_msgs/Header: seq, stamp.secs, stamp.nsecs (uint32 little endian), then the frame's name
    assert header_stamp_s(struct.pack("<IIII3s", 7, 12, 500_000_000, 3, b"map")) == 12.5


def test_parameters_have_defaults_and_are_converted():
    assert settings_from_params({}) == SimulatorSettings()
    settings = settings_from_params({"seed": 3, "rate": 2, "pace_topics": "/a, /b", "boot_before_s": 0})
    assert (settings.seed, settings.rate, settings.pace_topics, settings.boot_before_s) == (3, 2.0, ("/a", "/b"), 0.0)
    assert settings_from_params({"pace_topics": ["/a"]}).pace_topics == ("/a",)


@pytest.mark.parametrize(
    ("params", "said"), [({"speed": 1}, "~speed"), ({"seed": "x"}, "~seed"), ({"seed": 1.5}, "~seed"), ({"rate": -1}, "~rate")]
)
def test_a_wrong_parameter_is_named(params, said):
    with pytest.raises(ConfigError, match=said):
        settings_from_params(params)


def test_parameters_of_the_autopilot_are_read():
    assert parse_parameters("FS_GCS_ENABLE=1, LAND_SPEED=30") == {"FS_GCS_ENABLE": 1.0, "LAND_SPEED": 30.0}
    assert parse_parameters("") == {}
    for wrong, said in (("FS_GCS=1", "no 'FS_GCS'.*did you mean"), ("LAND_SPEED", "'' is no number")):
        with pytest.raises(ConfigError, match=said):
            parse_parameters(wrong)


def test_pilot_words():
    link = Link().flying()
    apply_pilot_word("LOITER", link.pilot, link.endpoint)
    assert link.pilot.mode is Mode.LOITER
    apply_pilot_word("RC_LOST", link.pilot, link.endpoint)
    assert link.pilot.mode is Mode.RTL
    apply_pilot_word("GCS_LOST", link.pilot, link.endpoint)
    assert not link.endpoint.gcs_present
    for wrong, said in (
        ("JUMP", "unknown word 'JUMP'"),
        ("YAW_STICK left", "not 'left'"),
        ("THROTTLE up", "THROTTLE needs a number from -1 to 1, not 'up'"),
    ):
        with pytest.raises(ConfigError, match=said):
            apply_pilot_word(wrong, link.pilot, link.endpoint)


@pytest.mark.parametrize("kind", [TcpLink, UdpLink])
def test_a_taken_port_is_named(kind):
    first = kind(Link().endpoint, 0)
    try:
        with pytest.raises(SimulatorError, match=str(first.port)):
            kind(Link().endpoint, first.port)
    finally:
        first.close()


def test_time_waits_for_a_node_that_knows_an_old_time_though_it_is_done_with_its_measurements():
    pacer = Pacer(["/node/done=zed", "/node/health=0.15"], limit_s=0.3, timeout_s=15.0)
    pacer.begin(1.0)
    pacer.heard("/node/health", 1.1)
    for stamp_s in (1.1, 1.2):
        pacer.measured("zed", stamp_s, stamp_s)
        pacer.heard("/node/done", stamp_s)
    assert pacer.may_advance(1.24, 0.0)
    assert not pacer.may_advance(1.26, 0.0)
    pacer.heard("/node/health", 1.2)
    assert pacer.may_advance(1.26, 0.0)
