from __future__ import annotations

import json
import xml.etree.ElementTree as ET

import pytest
from uav_missions_fakes import FakeClient, World, make_mission

from alula.missions.director import EXIT_CODES, Director, Outcome
from alula.missions.drawing import draw
from alula.missions.pausing import PauseRefusedError
from alula.model.execution_state import ExecutionState

READY = {
    "height_status": "AGREED",
    "imu_status": "OK",
    "position_status": "KNOWN",
    "SDK_authority": "AVAILABLE",
    "flight_status": "ON_GROUND",
    "homepoint_status": "VALID",
    "link": "UP",
    "zed_status": "OK",
    "lidar_status": "OK",
}


def make(world: World) -> Director:
    return Director(*make_mission(world), start_timeout_s=60.0)


def run(director: Director, world: World, until=lambda: False, limit_s: float = 200.0) -> None:
    while director.end is None and not until():
        assert world.now_s < limit_s, world.log[-8:]
        director.step()
        world.pass_time()


def test_nothing_starts_before_the_vehicle_is_ready_and_the_wait_is_bounded():
    world = World(resources={**READY, "homepoint_status": "INVALID", "lidar_status": "UNKNOWN"})
    director = make(world)
    run(director, world)
    assert director.end.outcome is Outcome.NOT_STARTED
    assert director.end.reason == "the home point is not valid; nothing is known of the LiDAR"
    assert EXIT_CODES[director.end.outcome] == 2
    assert world.now_s == pytest.approx(60.2, abs=0.3)
    assert world.starts() == []


@pytest.mark.parametrize(
    ("resource", "state"),
    [
        ("SDK_authority", "UNAVAILABLE"),
        ("homepoint_status", "INVALID"),
        ("link", "UNKNOWN"),
        ("link", "DOWN"),
        ("flight_status", "IN_AIR"),
        ("zed_status", "UNKNOWN"),
        ("lidar_status", "UNKNOWN"),
        ("lidar_status", "BROKEN"),
    ],
)
def test_each_condition_of_the_start_counts(resource, state):
    assert unmet(World(resources=dict(READY))) == []
    assert len(unmet(World(resources={**READY, resource: state}))) == 1


def unmet(world: World, **reasons: str) -> list[str]:
    world.reasons.update(reasons)
    mission, _ = make_mission(world)
    return [one.unmet for one in mission.conditions() if one.unmet]


def test_a_missing_driver_is_named():
    world = World(resources={**READY, "zed_status": "UNKNOWN"})
    assert unmet(world, zed_status="no images on /zed/left/image_raw") == ["nothing is known of the ZED: no images on /zed/left/image_raw"]


def test_a_skillset_that_can_not_be_called_keeps_the_mission_from_starting():
    world = World(resources=dict(READY))
    mission, _ = make_mission(world, mapping=FakeClient("mapping", world, ready=False))
    every = mission.conditions()
    assert [one.unmet for one in every if one.unmet] == ["the skillset mapping can't be called"]
    assert [one.needed for one in every] == [
        *(f"the skillset {name} answers" for name in ("navigation", "perception", "mapping")),
        "the autopilot is ready and ours to command",
        "the home point is valid",
        "the position is known",
        "the vehicle's computer is heard of",
        "the vehicle is on the ground",
        "the state of the ZED is known",
        "the LiDAR works",
    ]


def test_a_broken_zed_does_not_keep_the_mission_from_starting():
    world = World(resources={**READY, "zed_status": "BROKEN"}, broken={"zed"})
    director = make(world)
    run(director, world)
    assert director.end.outcome is Outcome.DEGRADED
    assert director.end.reason.startswith("perception.zed_depthmap: NOT_READY")


def test_a_nominal_flight_is_accomplished():
    world = World(resources=dict(READY))
    director = make(world)
    run(director, world)
    assert director.end.outcome is Outcome.ACCOMPLISHED
    assert not world.running()


def test_a_flight_without_eyes_is_given_up_with_the_reason():
    world = World(resources=dict(READY))
    director = make(world)
    run(director, world, until=lambda: ("running", "goto_straight") in world.log)
    world.break_sensor("zed")
    world.break_sensor("lidar")
    run(director, world)
    assert director.end.outcome is Outcome.GIVEN_UP
    assert "zed_ok" in director.end.reason
    assert EXIT_CODES[director.end.outcome] == 1


def test_an_abort_in_the_air_stops_everything_and_lands():
    world = World(resources=dict(READY))
    director = make(world)
    run(director, world, until=lambda: ("running", "goto_straight") in world.log)
    assert director.abort("operator") == "the robot stops where it is"
    assert director.abort("operator again") == "the robot is being stopped already"
    run(director, world)
    assert director.end.outcome is Outcome.ABORTED
    assert director.end.reason == "operator"
    assert world.starts()[-2:] == ["hover", "land"]
    assert world.resources["flight_status"] == "ON_GROUND"
    assert not world.running()
    assert not world.conflicts


def test_an_abort_before_the_start_starts_nothing():
    world = World(resources={**READY, "homepoint_status": "INVALID"})
    director = make(world)
    director.step()
    director.abort("operator")
    assert director.end.outcome is Outcome.ABORTED
    assert world.starts() == []


def test_an_abort_while_landing_leaves_the_landing_alone():
    world = World(resources=dict(READY))
    director = make(world)
    run(director, world, until=lambda: ("running", "land") in world.log)
    assert director.abort("operator") == "the robot is being stopped already"
    run(director, world)
    assert director.end.outcome is Outcome.ACCOMPLISHED
    assert world.starts().count("land") == 1


def test_the_view_remembers_how_each_node_ended():
    world = World(resources=dict(READY))
    director = make(world)
    run(director, world, until=lambda: ("running", "goto_straight") in world.log)
    director.view()
    world.break_sensor("zed")
    while director.end is None:
        director.step()
        director.view()
        world.pass_time()
    status = {view.skill: view.status for view in director.view().walk() if view.skill}
    assert status["perception.zed_depthmap"] == "FAILURE"
    assert status["navigation.goto_straight"] == "INTERRUPTED"
    assert status["perception.lidar_depthmap"] == "INTERRUPTED"
    assert status["navigation.goto"] == "SUCCESS"
    assert status["mapping.lidar_mapping"] == "INTERRUPTED"
    assert json.loads(json.dumps(director.view().as_dict()))["status"] == "SUCCESS"


def test_the_drawing_shows_every_node_in_the_signs_of_the_paper():
    world = World(resources=dict(READY))
    director = make(world)
    run(director, world)
    view = director.view()
    svg = draw(view, "Mission <mapping>")
    root = ET.fromstring(svg)  # noqa: S314 - our own
    space = "{http://www.w3.org/2000/svg}"
    texts = [element.text for element in root.iter(f"{space}text")]
    assert sum(text == "? navigate (Fallback)" for text in texts) == 1
    assert "take off (takeoff)" in texts
    nodes = list(view.walk())
    shapes = [element for element in root.iter() if element.tag in {f"{space}rect", f"{space}polygon"}]
    legend_and_background = len({view.kind for view in nodes}) + 1
    assert len(shapes) == len(nodes) + legend_and_background
    trapeziums = [element for element in shapes if element.tag == f"{space}polygon"]
    assert len(trapeziums) == sum(view.kind == "parallel" for view in nodes) + 1
    width = float(root.get("width"))
    for element in shapes:
        if element.tag == f"{space}rect" and element.get("x"):
            assert float(element.get("x")) + float(element.get("width")) <= width


# --- pause -----------------------------------------------------------------------------------------------------------------


def paused_on_the_way(world: World) -> Director:
    """Return a mission that is paused while it flies straight."""
    director = make(world)
    run(director, world, until=lambda: ("running", "goto_straight") in world.log)
    director.pause()
    return director


def pass_time(director: Director, world: World, duration_s: float) -> list[str]:
    """Step through a time; return the news of the pause."""
    news = []
    end_s = world.now_s + duration_s
    while world.now_s < end_s:
        director.step()
        news.append(director.news_of_pause())
        world.pass_time()
    return [words for words in news if words]


def test_a_paused_mission_holds_what_can_hold_and_goes_on_where_it_was():
    world = World(resources=dict(READY))
    director = paused_on_the_way(world)
    starts, tree = len(world.starts()), director.view().as_dict()
    (news,) = pass_time(director, world, 30.0)
    assert "navigation.goto_straight holds" in news
    assert "perception.zed_depthmap goes on (zed_depthmap can't be paused)" in news
    assert "mapping.lidar_mapping goes on" in news
    assert (len(world.starts()), director.view().as_dict()) == (starts, tree)
    assert [handle.skill for handle in world.running() if handle.state is ExecutionState.PAUSED] == ["goto_straight"]
    director.resume()
    run(director, world)
    assert director.end.outcome is Outcome.ACCOMPLISHED
    assert not world.conflicts


def test_a_climb_is_finished_and_nothing_follows_before_the_mission_goes_on():
    world = World(resources=dict(READY))
    director = make(world)
    run(director, world, until=lambda: ("running", "takeoff") in world.log)
    director.pause()
    news = pass_time(director, world, 10.0)
    assert ("end", "takeoff", "AT_ALTITUDE") in world.log
    assert news[-1] == "navigation.takeoff has ended"
    assert world.starts() == ["takeoff"]
    director.resume()
    run(director, world)
    assert director.end.outcome is Outcome.ACCOMPLISHED


def test_a_skill_that_is_just_being_started_is_asked_again():
    world = World(resources=dict(READY), not_yet={"goto_straight"})
    director = paused_on_the_way(world)
    world.not_yet.clear()
    assert ["goto_straight holds" in news for news in pass_time(director, world, 2.0)] == [True]


def test_a_failure_during_a_pause_is_dealt_with_when_the_mission_goes_on():
    world = World(resources=dict(READY))
    director = paused_on_the_way(world)
    world.break_sensor("zed")
    pass_time(director, world, 5.0)
    assert "lidar_depthmap" not in world.starts()
    director.resume()
    run(director, world)
    assert director.end.outcome is Outcome.DEGRADED
    assert not world.conflicts


def test_a_skill_that_can_not_go_on_is_interrupted_so_that_the_tree_goes_on():
    world = World(resources=dict(READY), forgets={"goto_straight"})
    director = paused_on_the_way(world)
    pass_time(director, world, 1.0)
    director.resume()
    run(director, world)
    assert ("interrupt", "goto_straight") in world.log
    assert director.end is not None
    assert not world.running()


def test_an_abort_ends_the_pause_and_lands():
    world = World(resources=dict(READY))
    director = paused_on_the_way(world)
    pass_time(director, world, 1.0)
    assert director.abort("operator") == "the robot stops where it is"
    run(director, world)
    assert director.end.outcome is Outcome.ABORTED
    assert world.resources["flight_status"] == "ON_GROUND"
    assert not world.running()


def test_what_can_not_be_paused_says_why():
    world = World(resources=dict(READY))
    director = make(world)

    def refusal() -> str:
        with pytest.raises(PauseRefusedError) as refused:
            director.pause()
        return str(refused.value)

    assert refusal() == "the mission has not started"
    with pytest.raises(PauseRefusedError, match="the mission is not paused"):
        director.resume()
    run(director, world, until=lambda: ("running", "land") in world.log)
    assert refusal() == "the robot is being stopped already"
    run(director, world)
    assert refusal() == "the mission is over already"
