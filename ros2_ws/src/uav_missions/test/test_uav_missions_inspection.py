"""The inspection over mocks, in virtual time: what the tree does when the video, the radio, a sensor or the pilot fails."""

from __future__ import annotations

import itertools
import random
from dataclasses import replace

import pytest

from alula import Mission, MockedMission, Outcome
from uav_missions.route import route_of

MISSION = Mission.load("inspection")
ROUTE = route_of(MISSION.plan.inputs).waypoints


def fly(*faults: str, seed: int = 0, tick_period_s: float = 0.1) -> MockedMission:
    mission = MISSION.mocked(*faults, seed=seed, tick_period_s=tick_period_s)
    mission.run()
    return mission


def ends(mission: MockedMission) -> list[tuple[str, str, str]]:
    """Return how the executions ended, in the order in which they did."""
    return [(event.skill, event.state.name, event.result) for event in mission.ended]


def on_ground(mission: MockedMission) -> bool:
    return mission.state("navigation", "flight_status") == "ON_GROUND"


def test_the_plan_has_the_scenarios_name_and_skillsets():
    assert (MISSION.plan.scenario, MISSION.plan.skillsets) == ("inspection", tuple(one.name for one in MISSION.skillsets))


def test_a_nominal_flight_goes_all_around_with_the_nose_to_the_walls():
    mission = fly()
    assert mission.end.outcome is Outcome.ACCOMPLISHED
    assert on_ground(mission)
    assert not mission.notes
    skills = [skill for skill, _, _ in ends(mission)]
    assert skills.count("goto") == len(ROUTE)
    assert [end for end in ends(mission) if end[0] == "stream"] == [("stream", "INTERRUPTED", "")], "only when the flight is over"
    assert skills.index("stream") < skills.index("land")


def test_a_lost_video_stops_hovers_and_lands_in_this_order():
    mission = fly("radio@40")
    assert mission.end.outcome is Outcome.DEGRADED
    assert "enough_frames" in mission.end.reason
    last = ends(mission)
    begin = last.index(("stream", "RESOURCE_INVARIANT_VIOLATED", "enough_frames"))
    motion = [end for end in last[begin:] if end[0] in {"goto", "hover", "land"}]
    assert motion == [("goto", "INTERRUPTED", ""), ("hover", "TERMINATED", "DONE"), ("land", "TERMINATED", "LANDED")]
    assert on_ground(mission)


def test_from_the_stream_s_failure_to_hover_takes_less_than_a_second():
    mission = fly("radio@40")
    hover, stream = ([one for one in mission.executions if one.skill == skill][-1] for skill in ("hover", "stream"))
    assert stream.state.name == "RESOURCE_INVARIANT_VIOLATED"
    assert 0 < hover.started_ns - stream.ended_ns < 1e9


def test_a_dead_encoder_is_told_as_such_and_ends_the_flight_as_a_lost_video_does():
    mission = fly("encoder@40")
    assert mission.end.outcome is Outcome.DEGRADED
    assert mission.end.reason.startswith("video.stream: LOST")
    last = ends(mission)
    motion = [end for end in last[last.index(("stream", "TERMINATED", "LOST")) :] if end[0] in {"goto", "hover", "land"}]
    assert motion == [("goto", "INTERRUPTED", ""), ("hover", "TERMINATED", "DONE"), ("land", "TERMINATED", "LANDED")]
    assert on_ground(mission)


CUT_OFF = """
skills:
  navigation.hover: {delay: 3.2, result: ABORTED, message: nothing is heard of the guidance}
  navigation.land: {delay: 0.2, result: ABORTED, message: "refused: on the ground", then: [], moves: {}}
"""
"""What a vehicle answers that its dead man lands while the link is away."""


@pytest.mark.parametrize(("told_s", "landings"), [(74.3, []), (75.5, [("TERMINATED", "ABORTED")])], ids=["at once", "later than the link"])
def test_a_lost_link_that_ends_the_video_first_is_waited_for_before_anything_else_is_asked_of_the_vehicle(tmp_path, told_s, landings):
    down = f"timeline: [{{after: {told_s}, set: {{navigation.flight_status: ON_GROUND}}}}]\n"
    (tmp_path / "cut_off.yaml").write_text(CUT_OFF + down)
    cut_off = Mission.load("inspection", behaviour=[tmp_path / "cut_off.yaml"])
    mission = cut_off.mocked("encoder@40", "link:silent@44.5-72.5")  # the one from lift-off, the other from the start
    assert mission.run().outcome is Outcome.DEGRADED
    assert mission.end.reason.startswith("video.stream: LOST")
    links = {event.to_state: event.stamp_ns for event in mission.events if getattr(event, "resource", "") == "link"}
    hover, *asked = [one for one in mission.executions if one.skill in {"hover", "land"}]
    assert hover.started_ns < links["UNKNOWN"] < hover.ended_ns, "it is asked for before the link is known to be lost"
    assert all(one.requested_ns > links["UP"] for one in asked)
    assert [(one.state.name, one.result) for one in asked] == landings
    assert on_ground(mission)


def test_without_the_ground_station_the_video_goes_first_and_then_the_failsafe_has_the_vehicle():
    mission = fly("ground_station@40")
    assert mission.end.outcome is Outcome.GIVEN_UP
    assert mission.end.reason.index("enough_frames") < mission.end.reason.index("keep_sdk_authority")
    assert ("hover", "RESOURCE_INVARIANT_VIOLATED", "keep_sdk_authority") in ends(mission)
    assert on_ground(mission), "the failsafe's landing is waited for"


def test_a_degraded_radio_ends_nothing():
    assert fly("radio:degraded@40").end.outcome is Outcome.ACCOMPLISHED


def test_a_short_loss_of_the_radio_is_forgiven():
    mission = fly("radio@40-40.5")
    assert mission.end.outcome is Outcome.ACCOMPLISHED


def test_a_video_that_comes_back_while_it_hovers_does_not_call_it_back():
    mission = fly("radio@40-44")
    assert mission.end.outcome is Outcome.DEGRADED
    assert [end for end in ends(mission) if end[0] == "land"] == [("land", "TERMINATED", "LANDED")]


def test_the_zed_is_not_needed():
    assert fly("zed@20").end.outcome is Outcome.ACCOMPLISHED


def test_without_the_sensor_that_looks_ahead_it_is_given_up_and_landed():
    mission = fly("lidar@20")
    assert mission.end.outcome is Outcome.GIVEN_UP
    assert "lidar_ok" in mission.end.reason
    assert on_ground(mission)


@pytest.mark.parametrize("taker", ["pilot", "control"])
def test_the_vehicle_is_left_to_its_taker_until_it_is_down(taker: str):
    mission = fly(f"{taker}@20")
    assert mission.end.outcome is Outcome.GIVEN_UP
    taken = itertools.dropwhile(lambda end: end[1] != "RESOURCE_INVARIANT_VIOLATED", ends(mission))
    after = [end for end in taken if end[0] in {"hover", "land"}]
    assert after == [], "nothing is commanded any more"
    assert on_ground(mission) is (taker == "control"), "the failsafe lands; a pilot does as he likes"


def test_without_a_ground_station_the_drone_does_not_take_off():
    mission = fly("radio")
    assert mission.end.outcome is Outcome.NOT_STARTED
    assert "ground station" in mission.end.reason


def test_an_encoder_that_was_never_heard_of_is_named_and_not_the_radio_alone():
    link = ("video", "link")
    silent = replace(MISSION.behaviour, timeline=tuple(event for event in MISSION.behaviour.timeline if link not in event.states))
    end = replace(MISSION, behaviour=silent).run()
    assert end.outcome is Outcome.NOT_STARTED
    assert "neither the video encoder nor the ground station" in end.reason


def test_whatever_fails_whenever_it_comes_to_an_end():
    for seed in range(20):
        chance = random.Random(seed)  # noqa: S311 - no secret
        names = chance.sample(["radio", "zed", "lidar", "encoder", "ground_station"], chance.randint(1, 3))
        mission = fly(*(f"{name}@{chance.uniform(0.0, 200.0):.2f}" for name in names), seed=seed, tick_period_s=1.0)
        assert on_ground(mission), (seed, names)
        assert not mission.open_executions, (seed, names)
        assert mission.end.outcome in {Outcome.ACCOMPLISHED, Outcome.DEGRADED, Outcome.GIVEN_UP}
