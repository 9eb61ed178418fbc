"""What is told of the autopilot's height beside the map's: by how much they are apart, and since when it counts."""

from __future__ import annotations

from types import SimpleNamespace

from hypothesis import given
from hypothesis import strategies as st

from lidar_mapping.core import HEIGHT_AGREES_M, HEIGHT_DRIFT_M, HEIGHT_WRONG_M, LidarMapping, height_status
from lidar_mapping.settings import MappingSettings

STATES = ("AGREED", "DRIFTING", "WRONG")


class Host:
    """Keeps what is reported of the heights."""

    def __init__(self) -> None:
        self.told: list[tuple[str, str]] = []

    def report(self, resource: str, state: str, reason: str = "") -> None:
        if resource == "mapping.height_status":
            self.told.append((state, reason))

    def warn(self, *_about: object, **_how: object) -> None:
        pass

    def publish(self, *_what: object) -> None:
        pass

    def now_ns(self) -> int:
        return 0


def reports(*drifted_m: float, problem: str = "") -> list[tuple[str, str]]:
    host = Host()
    core = LidarMapping(MappingSettings(resume=False), host)
    core.switch(True)
    host.told.clear()
    for off_m in drifted_m:
        core._slam = SimpleNamespace(problem=problem, height_drift_m=off_m)
        core._report()
    return host.told


def test_a_drift_is_told_once_with_its_size_and_direction_and_stays_told_while_it_wavers() -> None:
    assert reports(0.1, 0.19, 0.21, 0.19, 0.22, 0.16) == [
        ("DRIFTING", "the autopilot takes the vehicle to be 0.21 m higher than it is in the map")
    ]
    assert reports(-0.1, -0.25, -0.1) == [
        ("DRIFTING", "the autopilot takes the vehicle to be 0.25 m lower than it is in the map"),
        ("AGREED", ""),
    ]


def test_heights_two_metres_apart_are_wrong_until_a_mapping_begins_again() -> None:
    assert [state for state, _ in reports(1.0, 2.1, 0.0)] == ["DRIFTING", "WRONG"]
    host = Host()
    core = LidarMapping(MappingSettings(resume=False), host)
    core._height = "WRONG"
    core.switch(False)
    assert host.told == [], "what was found stays after the mapping"
    core.switch(True)
    assert host.told == [("AGREED", "")]


def test_a_map_that_is_lost_says_nothing_of_heights() -> None:
    assert reports(1.0, 3.0, problem="no scan fitted the map for 2.1 s") == []


@given(st.floats(-10.0, 10.0), st.sampled_from(STATES))
def test_a_state_says_how_far_the_heights_are_apart(drifted_m: float, before: str) -> None:
    state, off_m = height_status(drifted_m, before), abs(drifted_m)
    assert height_status(-drifted_m, before) == state
    if before != "WRONG":
        assert (state == "WRONG") == (off_m > HEIGHT_WRONG_M)
        assert state != "AGREED" or off_m <= HEIGHT_DRIFT_M
        assert state != "DRIFTING" or off_m > HEIGHT_AGREES_M
