"""Robots on two computers: what its judge says of where it truly was, and a whole mission with a cut link where that is asked for."""

from __future__ import annotations

import os
from dataclasses import replace

import pytest
from link_rig.__main__ import main
from link_rig.cases import CASES, run_case
from link_rig.verdicts import HEAD, End, Fault, Pose, Still, Survived, driving_since, judge, judge_kills

STEP_S = 0.05
CUT = Fault("link cut for 5 s", 10.0, 15.0, ("link",))
SURVIVED = End("accomplished", "")
FLIES = Still(m_s=0.3, rad_s=0.2, flies=True)
RIG = "ALULA_LINK_RIG"
"""The environment variable that has a whole mission run with a cut link."""


def driven(*legs):
    """Return the poses of a rover that drives (0.5 m/s) or stands, each for so many seconds: (speed, seconds)."""
    poses, x, stamp_s = [], 0.0, 0.0
    for speed_m_s, lasts_s in legs:
        for _ in range(round(lasts_s / STEP_S)):
            poses.append(Pose(100.0 + stamp_s, stamp_s, x, 0.0, 0.0))
            x, stamp_s = x + speed_m_s * STEP_S, stamp_s + STEP_S
    return poses


def judged(poses, end=SURVIVED, **options):
    beats = [0.5 * n for n in range(200)]
    return judge(options.pop("fault", CUT), end, poses, **{"beats": beats, "collisions": 0, "silent_after_s": 2.0, **options})


def test_a_rover_that_stops_in_time_and_goes_on_is_told_with_its_times():
    verdict = judged(driven((0.5, 12.0), (0.0, 5.5), (0.5, 5.0)))
    assert verdict.wrong == ()
    assert verdict.moved_on_s == pytest.approx(2.0, abs=STEP_S)
    assert verdict.stood_s == pytest.approx(5.5, abs=STEP_S)
    assert verdict.went_on_s == pytest.approx(2.5, abs=STEP_S)
    assert verdict.row == "| link cut for 5 s | 2.0 | 0.5 | 0 | 5.5 | 2.5 | - | accomplished | - |\n"
    assert verdict.row.count("|") == HEAD.splitlines()[0].count("|")


def test_a_rover_that_stops_long_after_a_fault_was_not_stopped_by_it():
    verdict = judged(driven((0.5, 60.0), (0.0, 20.0)), fault=replace(CUT, ended_s=10.2))
    assert (verdict.moved_on_s, verdict.stood_s, verdict.went_on_s, verdict.wrong) == (None, None, None, ())


def test_a_pause_of_a_driving_rover_is_no_stop():
    assert judged(driven((0.5, 10.5), (0.0, 0.5), (0.5, 1.2), (0.0, 8.0))).moved_on_s == pytest.approx(2.2, abs=2 * STEP_S)


@pytest.mark.parametrize(
    ("legs", "told"),
    [
        ([(0.5, 30.0)], "it moved on all the time: 3 s are allowed"),
        ([(0.5, 14.0), (0.0, 10.0)], "it moved on for 4.0 s: 3 s are allowed"),
        ([(0.5, 11.0), (0.0, 2.0), (0.5, 10.0)], "it moved again 2.0 s before the fault's end"),
    ],
)
def test_a_rover_that_moves_unsupervised_is_wrong(legs, told):
    (wrong,) = judged(driven(*legs)).wrong
    assert wrong == told


def test_a_rover_that_moves_while_its_managers_are_not_heard_is_wrong_whatever_the_fault():
    drives, fault = driven((0.5, 13.0), (0.0, 5.0), (0.5, 5.0)), replace(CUT, stops=False)
    heard = judged(drives, fault=fault)
    assert heard.wrong == ()
    assert heard.unheard_s == pytest.approx(0.5, abs=STEP_S)
    until_then = [0.5 * n for n in range(20)]
    unheard = judged(drives, fault=fault, beats=[*until_then, 17.0, *(18.0 + 0.5 * n for n in range(20))])
    assert unheard.wrong == ("it moved for 3.5 s while nothing was heard of its managers: 3 s are allowed",)
    assert judged(drives, fault=fault, beats=[]).unheard_s == 0.0, "a supervision that has not begun"


def test_missions_that_are_killed_at_have_to_name_what_was_killed_and_the_last_one_is_accomplished():
    def judged(*missions):
        beats = [0.5 * n for n in range(200)]
        return judge_kills("3 kills", missions, driven((0.5, 20.0)), beats=beats, collisions=0, silent_after_s=2.0)

    true, false = End("degraded", "the bridge died"), End("given_up", "no map")
    fine = judged(Survived(true, ("bridge",)), Survived(SURVIVED, ()))
    assert (fine.wrong, fine.end) == ((), End("1 accomplished, 1 degraded", "1: the bridge died"))
    assert fine.row == "| 3 kills | - | 0.5 | 0 | - | - | - | 1 accomplished, 1 degraded | 1: the bridge died |\n"
    assert judged(Survived(false, ("bridge",)), Survived(SURVIVED, ())).wrong == (
        "mission 1 ended with 'no map', which names none of: bridge",
    )
    assert len(judged(Survived(SURVIVED, ()), Survived(true, ())).wrong) == 1


def flown(*legs):
    """Return the poses of a drone that flies, each for so many seconds: (forwards, upwards, seconds), m/s."""
    poses, x, z, stamp_s = [], 0.0, 0.0, 0.0
    for forwards, upwards, lasts_s in legs:
        for _ in range(round(lasts_s / STEP_S)):
            poses.append(Pose(100.0 + stamp_s, stamp_s, x, 0.0, 0.0, z))
            x, z, stamp_s = x + forwards * STEP_S, max(0.0, z + upwards * STEP_S), stamp_s + STEP_S
    return poses


def test_a_drone_that_hovers_and_lands_by_itself_is_supervised():
    verdict = judged(
        flown((0.0, 1.0, 3.0), (1.0, 0.0, 9.0), (0.1, 0.0, 8.0), (0.0, -0.5, 7.0)), still=FLIES, fault=replace(CUT, ended_s=40.0)
    )
    assert verdict.wrong == ()
    assert verdict.moved_on_s == pytest.approx(2.0, abs=STEP_S)
    assert verdict.down_s == pytest.approx(10.0 + 5.4, abs=2 * STEP_S), "at 0.3 m"


def test_a_drone_that_climbs_unheard_or_stays_in_the_air_is_wrong():
    climbs = judged(flown((0.0, 0.0, 12.0), (0.0, 0.5, 6.0), (0.0, -1.0, 6.0)), still=FLIES, beats=[0.5 * n for n in range(21)])
    assert climbs.moved_on_s == 0.0, "it stood on the ground when the fault came"
    assert climbs.wrong == (
        "it moved for 8.0 s while nothing was heard of its managers: 3 s are allowed",
        "it moved again 3.0 s before the fault's end",
    )
    hangs = judged(flown((0.0, 1.0, 3.0), (1.0, 0.0, 9.0), (0.0, 0.0, 9.0)), still=FLIES)
    assert hangs.wrong == ("it is in the air still",)
    assert hangs.down_s is None


@pytest.mark.parametrize(("brakes_s", "allowed_s"), [(0.0, 3.0), (1.1, 4.1)])
def test_what_brakes_for_a_while_may_move_on_for_as_long(brakes_s, allowed_s):
    still = replace(FLIES, brakes_s=brakes_s)
    for moved_s, is_wrong in ((allowed_s - 0.2, False), (allowed_s + 0.2, True)):
        flight = flown((0.0, 1.0, 3.0), (1.0, 0.0, 7.0 + moved_s), (0.0, 0.0, 5.0), (0.0, -0.5, 7.0))
        assert bool(judged(flight, still=still).wrong) is is_wrong


def test_turning_is_moving():
    turning = [Pose(one.at_s, one.stamp_s, 0.0, 0.0, 0.5 * one.stamp_s) for one in driven((0.0, 30.0))]
    assert judged(turning).wrong == ("it moved on all the time: 3 s are allowed",)


def test_collisions_false_causes_and_a_next_mission_that_fails_are_wrong():
    stopped = driven((0.5, 11.0), (0.0, 20.0))
    assert judged(stopped, collisions=2).wrong == ("it ran into something 2 times",)
    assert judged(stopped, End("given_up", "the link did not come back")).wrong == ()
    assert len(judged(stopped, End("given_up", "the battery is empty")).wrong) == 1
    assert judged(stopped, following=SURVIVED).wrong == ()
    assert judged(stopped, following=End("given_up", "no map")).wrong == ("the next mission was given_up: no map",)


def test_since_when_it_drives_is_told_while_it_drives_only():
    assert driving_since([]) is None
    assert driving_since(driven((0.0, 3.0), (0.5, 3.0))) == pytest.approx(3.0, abs=STEP_S)
    assert driving_since(driven((0.5, 3.0), (0.0, 3.0))) is None


def test_what_an_earlier_run_has_left_is_not_taken_for_this_ones(tmp_path, capsys):
    (tmp_path / "cut-5/run1").mkdir(parents=True)
    assert main(["--case", "cut-5", "--keep", str(tmp_path)]) == 2
    assert "cut-5 is not empty" in capsys.readouterr().err


@pytest.mark.skipif(RIG not in os.environ, reason=f"takes two minutes and root: {RIG}=cut-5 runs this case, or another of tools/link_rig")
@pytest.mark.flight
@pytest.mark.timeout(1800)
def test_a_rover_whose_link_is_cut_stops_in_time_and_its_mission_goes_on(tmp_path):
    verdict = run_case(CASES[os.environ[RIG]], tmp_path)
    assert verdict.wrong == ()
