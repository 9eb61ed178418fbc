from __future__ import annotations

import json
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from uav_missions.route import Route, RouteError, inputs_of, wrap_rad


def test_legs_have_their_direction_on_the_ground_and_short_ones_that_of_a_neighbour():
    route = Route([(0.0, 0.0, 3.0), (22.0, 0.0, 3.0), (22.0, 14.0, 3.0), (22.0, 14.0, 5.0)])
    headings = []
    while not route.done:
        headings.append(route.leg_heading_rad())
        route.reached += 1
    assert headings == pytest.approx([0.0, 0.0, math.pi / 2, math.pi / 2])
    assert route.current is None


@given(st.floats(-1e3, 1e3))
def test_a_wrapped_angle_is_the_same_angle_in_half_a_turn(angle_rad):
    wrapped = wrap_rad(angle_rad)
    assert -math.pi < wrapped <= math.pi
    assert math.cos(wrapped) == pytest.approx(math.cos(angle_rad), abs=1e-9)
    assert math.sin(wrapped) == pytest.approx(math.sin(angle_rad), abs=1e-9)


def test_routes_are_read_from_yaml_and_json(tmp_path):
    yaml_file, json_file = tmp_path / "yard.yaml", tmp_path / "route.json"
    yaml_file.write_text("name: yard\nroute:\n  - [0, 0, 3.0]\n  - [22.0, 0.0, 3.0]\n")
    json_file.write_text(json.dumps({"route": [[0, 0, 3], [22, 0, 3]]}))
    assert inputs_of(yaml_file) == inputs_of(json_file) == {"route": [[0.0, 0.0, 3.0], [22.0, 0.0, 3.0]]}


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("route: []", "needs a `route`"),
        ("- 1", "has no key 'route'"),
        ("route: [[0, 0, 3], [0, 0]]", "waypoint 2 is [0, 0]"),
        ("route: [[0, 0, .nan]]", "waypoint 1"),
        ("route: [[0, 0, 'x']]", "waypoint 1"),
        ("route: [", "while parsing"),
    ],
)
def test_a_route_that_can_not_be_used_is_named_with_its_place(tmp_path, text, complaint):
    path = tmp_path / "bad.yaml"
    path.write_text(text)
    with pytest.raises(RouteError) as error:
        inputs_of(path)
    assert complaint in str(error.value)
    assert str(path) in str(error.value)


def test_a_missing_route_file_is_named(tmp_path):
    with pytest.raises(RouteError, match="nowhere"):
        inputs_of(tmp_path / "nowhere.yaml")
