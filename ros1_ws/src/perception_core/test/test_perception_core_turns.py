"""Parts of a turn are joined; what lost sectors is not taken for a part."""

from __future__ import annotations

import numpy as np
import pytest

from perception_core import NS, Sweep, SweepStamps, TurnJoiner


def arc(first_deg, last_deg, k, *, period_s, count=9000) -> Sweep:
    """Return the k-th message of a sensor at 10 m from a wall all around, the returns between two angles in its frame."""
    azimuth = np.radians(np.linspace(first_deg, last_deg, count, endpoint=False))
    points = 10.0 * np.column_stack([np.cos(azimuth), np.sin(azimuth), np.zeros(count)])
    return Sweep(NS + int(k * period_s * NS), points.astype(np.float32), np.linspace(0.0, period_s, count, dtype=np.float32))


@pytest.mark.parametrize("parts", [2, 3, 6])
def test_parts_are_joined_to_whole_turns_in_the_order_of_time(parts) -> None:
    joiner, width, period_s = TurnJoiner(), 360.0 / parts, 0.1 / parts
    for k in range(4 * parts):
        part = arc(k % parts * width - 180.0, (k % parts + 1) * width - 180.0, k, period_s=period_s)
        turn = joiner.joined(part)
        if k >= parts - 1:
            assert len(turn.points) == parts * len(part.points)
            assert (turn.stamp_ns, turn.end_ns) == (part.stamp_ns, part.end_ns)
            assert np.all(np.diff(turn.times_s) > -1e-6)
            assert float(turn.times_s[0]) == pytest.approx(period_s - 0.1, abs=1e-6)


@pytest.mark.parametrize(("first_deg", "last_deg"), [(-180.0, 180.0), (-35.0, 35.0), (-135.0, 135.0)])
def test_sweeps_that_look_the_same_way_are_not_joined(first_deg, last_deg) -> None:
    joiner = TurnJoiner()
    for k in range(4):
        sweep = arc(first_deg + 9.0 * k, last_deg + 9.0 * k, k, period_s=0.1)
        assert joiner.joined(sweep) is sweep


@pytest.mark.parametrize(("before_deg", "left_deg"), [(360.0, 180.0), (360.0, 60.0), (360.0, 30.0), (180.0, 60.0)])
def test_what_is_left_of_a_sweep_that_lost_sectors_is_no_part(before_deg, left_deg) -> None:
    joiner = TurnJoiner()
    for k in range(3):
        joiner.joined(arc(-before_deg / 2.0, before_deg / 2.0, k, period_s=0.1))
    for k in range(3, 6):
        rest = arc(-left_deg / 2.0, left_deg / 2.0, k, period_s=0.1)
        assert joiner.joined(rest) is rest


@pytest.mark.parametrize("seed", range(20))
def test_the_few_points_of_a_sweep_that_was_thinned_are_no_part(seed) -> None:
    joiner, rng = TurnJoiner(), np.random.default_rng(seed)
    joiner.joined(arc(-180.0, 180.0, 0, period_s=0.1))
    whole = arc(-180.0, 180.0, 1, period_s=0.1)
    thin = whole.select(np.sort(rng.choice(len(whole.points), 60, replace=False)))
    assert joiner.joined(thin) is thin


def test_what_is_left_of_a_half_turn_is_not_filled_up_by_the_half_before() -> None:
    joiner = TurnJoiner()
    for k in range(4):
        joiner.joined(arc(k % 2 * 180.0, k % 2 * 180.0 + 180.0, k, period_s=0.05))
    rest = arc(60.0, 100.0, 4, period_s=0.05, count=20)
    assert len(joiner.joined(rest).points) == 9000 + 20  # the other half only


def test_halves_of_another_time_are_not_joined() -> None:
    joiner = TurnJoiner()
    joiner.joined(arc(0.0, 180.0, 0, period_s=0.05))
    late = arc(180.0, 360.0, 10, period_s=0.05)
    assert joiner.joined(late) is late
    back = arc(0.0, 180.0, 9, period_s=0.05)  # a clock that goes back
    assert joiner.joined(back) is back
    nothing = Sweep(NS, np.full((100, 3), np.nan, np.float32), np.zeros(100, np.float32))
    assert joiner.joined(nothing) is nothing


def test_a_driver_that_stamps_the_end_of_its_sweeps_is_known_by_three_of_them() -> None:
    stamps = SweepStamps()
    for k in range(6):
        sweep = arc(-180.0, 180.0, k, period_s=0.2)
        begun = stamps.begun(sweep, sweep.stamp_ns + NS // 50)
        if k < 2:
            assert begun is sweep
        else:
            assert abs(begun.end_ns - sweep.stamp_ns) < 1000
            assert begun.end_ns - begun.stamp_ns == sweep.end_ns - sweep.stamp_ns


@pytest.mark.parametrize("came_s", [0.2, 0.18, -0.01])
def test_sweeps_that_come_at_their_end_and_stamps_of_the_future_are_left_alone(came_s) -> None:
    stamps = SweepStamps()
    for k in range(6):
        sweep = arc(-180.0, 180.0, k, period_s=0.2)
        assert stamps.begun(sweep, sweep.stamp_ns + int(came_s * NS)) is sweep


def test_a_clock_that_is_late_for_a_moment_moves_no_sweep() -> None:
    stamps = SweepStamps()
    for k in range(9):
        sweep = arc(-180.0, 180.0, k, period_s=0.2)
        assert stamps.begun(sweep, sweep.stamp_ns + int((0.2 if k % 3 else 0.05) * NS)) is sweep


@pytest.mark.parametrize("odd_s", [-0.02, 0.15], ids=["before its time is heard", "late"])
def test_one_sweep_that_comes_at_an_odd_time_does_not_change_what_is_known_of_the_driver(odd_s) -> None:
    stamps = SweepStamps()
    for k in range(12):
        sweep = arc(-180.0, 180.0, k, period_s=0.2)
        begun = stamps.begun(sweep, sweep.stamp_ns + int((odd_s if k in {4, 8, 9} else 0.02) * NS))
        assert k < 2 or abs(begun.end_ns - sweep.stamp_ns) < 1000, k


def test_a_driver_that_stamps_the_beginning_again_is_known_by_three_sweeps_too() -> None:
    stamps = SweepStamps()
    moved = []
    for k in range(9):
        sweep = arc(-180.0, 180.0, k, period_s=0.2)
        moved.append(stamps.begun(sweep, sweep.stamp_ns + int((0.02 if k < 4 else 0.22) * NS)) is not sweep)
    assert moved == [False, False, True, True, True, True, False, False, False]
