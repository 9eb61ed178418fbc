"""The whole procedure on flights through a yard of planes, with an autopilot whose position grows wrong."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace
from threading import Thread, Timer

import numpy as np
import pytest
from lidar_mapping_yard import Path
from scipy.spatial.transform import Rotation

from lidar_mapping import ImuReading, OdometrySettings, Slam, SlamSettings
from lidar_mapping.readings import ReadingQueue
from perception_bench.street import PERIOD_S, Drive, street
from perception_core import NS, PoseBuffer, PoseUnavailableError

pytestmark = pytest.mark.long
LAP_S = 24.0


def lap(t):
    """Once around the yard, smoothly from rest: 12 x 6 m, 24 s a lap."""
    phase = 2 * np.pi * (t - 2.0 * (1.0 - np.exp(-t / 2.0))) / LAP_S if t > 0.0 else 0.0
    return np.array([6.0 * np.cos(phase), 3.0 * np.sin(phase), 2.0])


def fly(path, slam, seconds, *, count=7000, **wrong) -> float:
    """Let a SLAM follow a path; return by how much its position is off at the end, metres."""
    rng = np.random.default_rng(7)
    for k in range(round(seconds * 10)):
        start_s = k / 10
        sweep = path.sweep(start_s, seed=k, count=count)
        slam.add(sweep, path.readings(start_s, start_s + 0.1, rng), path.autopilot(start_s + 0.1, **wrong), np.eye(4))
    pose, _ = slam.pose()
    return float(np.linalg.norm(pose[:3, 3] - path.position(slam._odometry.filter.stamp_ns * 1e-9)))


def off_the_yard(points) -> np.ndarray:
    x, y, z = points.T
    return np.min(np.abs([z, y - 7, y + 7, x - 10, x + 10]), axis=0)


@pytest.mark.parametrize("drift", [0.02, 0.05])
def test_the_autopilots_drift_does_not_get_into_pose_or_map(drift) -> None:
    path, slam = Path(lap, yaw=lambda t: 0.2 * np.sin(t)), Slam(SlamSettings())
    assert fly(path, slam, 35.0, count=2500, drift=drift) < 0.1
    way = [path.position(t) for t in np.arange(0.0, 35.05, 0.1)]
    assert np.linalg.norm(np.diff(way, axis=0), axis=1).sum() > 40.0
    assert slam.count.rejected == 0
    large = slam.map.points[slam.map.points[:, 2] > 1.7]  # above the crates
    assert np.sqrt(np.mean(off_the_yard(large) ** 2)) < 0.04
    given = path.autopilot(35.0, drift=drift).at([int(35.0e9)]).position[0]
    there = slam.T_map_odom @ np.append(given, 1.0)
    assert there[:3] == pytest.approx(path.position(35.0), abs=0.15)


def leg(t):
    """Along the yard from rest, 0.6 m/s, with half a metre to both sides."""
    way = 0.6 * (t - 2.0 * (1.0 - np.exp(-t / 2.0))) if t > 0.0 else 0.0
    return np.array([way - 8.0, 0.5 * np.sin(way / 3.0), 2.0])


SLOW_ERRORS_DEG = {
    "heading": lambda t: (0.0, 0.0, 0.5 - 0.5 * np.cos(np.pi * min(t / 20.0, 1.0))),
    "tilt": lambda t: (0.4 * np.sin(t / 6.0), 0.4 * np.cos(t / 8.0) - 0.4, 0.0),
    "heading at the start": lambda t: (0.0, 0.0, max(0.0, 1.0 - t / 2.0)),
}
"""What the autopilot's attitude is off about the axes of the map, by time, degrees."""


@pytest.mark.parametrize("kind", SLOW_ERRORS_DEG)
def test_the_autopilots_slow_error_of_attitude_does_not_bend_the_map(kind) -> None:
    path, slam, rng = Path(leg, across_deg=17.0), Slam(SlamSettings()), np.random.default_rng(7)
    off_deg = []
    for k in range(250):
        end_s = (k + 1) / 10
        given = path.autopilot(end_s, turned=lambda t: np.radians(SLOW_ERRORS_DEG[kind](t)))
        slam.add(path.sweep(k / 10, seed=k, count=2500), path.readings(k / 10, end_s, rng), given, np.eye(4))
        turn = slam.pose()[0][:3, :3] @ path.pose(end_s)[:3, :3].T
        off_deg.append(np.degrees(Rotation.from_matrix(turn).as_rotvec()))
    off_deg = np.array(off_deg)
    began_deg = SLOW_ERRORS_DEG[kind](0.0)[2]
    assert np.abs(off_deg[:, 2] - began_deg).max() < (0.3 if began_deg else 0.15)
    assert np.linalg.norm(off_deg[:, :2], axis=1).max() < 0.3
    back = Rotation.from_euler("z", -began_deg, degrees=True)  # a map is turned as the vehicle was taken to be when it began
    points = back.apply(slam.map.points - leg(0.0)) + leg(0.0)
    assert np.sqrt(np.mean(off_the_yard(points[points[:, 2] > 1.7]) ** 2)) < 0.02


def straight(t):
    """Along the yard from rest, 1 m/s, with half a metre to both sides."""
    way = t - 1.0 + np.exp(-t) if t > 0.0 else 0.0
    return np.array([way - 9.0, 0.5 * np.sin(way / 3.0), 2.0])


def off_level(slam, *, tilt_deg=0.0, raised=lambda _t: 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Follow the straight path for 16 m; return by how much the height, metres, and the pitch, degrees, are off with each sweep.

    The autopilot's pitch is off by ``tilt_deg``, and the accelerometer's bias says the same.
    """
    path, rng = Path(straight, across_deg=17.0), np.random.default_rng(7)
    leaning, pull = np.radians([0.0, tilt_deg, 0.0]), np.array([-9.81 * np.sin(np.radians(tilt_deg)), 0.0, 0.0])
    off = []
    for k in range(170):
        end_s = (k + 1) / 10
        readings = [replace(each, specific_force=each.specific_force + pull) for each in path.readings(k / 10, end_s, rng)]
        slam.add(
            path.sweep(k / 10, seed=k, count=2500), readings, path.autopilot(end_s, raised=raised, turned=lambda _t: leaning), np.eye(4)
        )
        pose = slam.pose()[0]
        turn = Rotation.from_matrix(pose[:3, :3] @ path.pose(end_s)[:3, :3].T)
        off.append((pose[2, 3] - path.position(end_s)[2], turn.as_rotvec(degrees=True)[1]))
    height_m, pitch_deg = np.array(off).T
    return height_m, pitch_deg


@pytest.mark.parametrize("tilt_deg", [0.5, -0.5])
def test_a_tilt_that_autopilot_and_accelerometer_agree_upon_does_not_tilt_the_map(tilt_deg) -> None:
    slam = Slam(SlamSettings())
    height_m, pitch_deg = off_level(slam, tilt_deg=tilt_deg)
    assert np.abs(height_m).max() < 0.05, "0.11 and more without the autopilot's height"
    assert abs(pitch_deg[-1]) < 0.2
    ground = slam.map.points[slam.map.points[:, 2] < 0.3]
    assert abs(np.polyfit(ground[:, 0], ground[:, 2], 1)[0]) < np.radians(0.15)


@pytest.mark.parametrize("height", ["wavering", "drifting", "jumping"])
def test_what_is_wrong_with_the_autopilots_height_does_not_bend_the_map(height) -> None:
    kinds = {
        "wavering": lambda t: 0.02 * np.sin(3.0 * t),
        "drifting": lambda t: 0.03 * np.sin(t / 20.0),
        "jumping": lambda t: float(t > 8.0),
    }
    height_m, pitch_deg = off_level(Slam(SlamSettings()), raised=kinds[height])
    assert np.abs(height_m).max() < 0.06
    assert np.abs(pitch_deg).max() < 0.3


def hover_and_go(t):
    """Stay for 6 s, then fly along the yard at 1 m/s."""
    return straight(max(0.0, t - 6.0))


def off_height(path, slam, seconds, raised) -> np.ndarray:
    """Follow a path with a height of the autopilot that is off by ``raised(t)``; return by how much the SLAM's is off with each sweep."""
    rng, off = np.random.default_rng(7), []
    for k in range(round(seconds * 10)):
        end_s = (k + 1) / 10
        slam.add(path.sweep(k / 10, seed=k, count=2500), path.readings(k / 10, end_s, rng), path.autopilot(end_s, raised=raised), np.eye(4))
        off.append(slam.pose()[0][2, 3] - path.position(end_s)[2])
    return np.array(off)


@pytest.mark.parametrize("rate_m_s", [0.015, -0.015, 0.03])
def test_a_height_of_the_autopilot_that_runs_away_does_not_take_the_map_along(rate_m_s) -> None:
    slam = Slam(SlamSettings())
    off_m = off_height(Path(hover_and_go, across_deg=17.0), slam, 23.0, lambda t: rate_m_s * t)
    assert np.abs(off_m).max() < 0.06, "0.3 m and more where its rate is no part of the estimate"
    assert slam.height_drift_m == pytest.approx(rate_m_s * 23.0, abs=0.06)
    assert slam.T_map_odom[2, 3] == pytest.approx(-rate_m_s * 23.0, abs=0.06)


@pytest.mark.parametrize("rate_m_s", [0.03, -0.03])
def test_a_height_that_begins_to_run_away_on_a_straight_leg_does_not_take_the_map_along(rate_m_s) -> None:
    slam = Slam(SlamSettings())
    off_m = off_height(Path(straight, across_deg=17.0), slam, 18.0, lambda t: rate_m_s * max(0.0, t - 6.0))
    assert np.abs(off_m).max() < 0.09, "0.29 m where the rate can't change at once"
    assert slam.height_drift_m == pytest.approx(rate_m_s * 12.0, abs=0.08)


@pytest.mark.parametrize("ground", ["slope", "roof"])
def test_neither_a_slope_nor_the_edge_of_a_roof_is_taken_for_a_drift_of_the_height(ground) -> None:
    slam = Slam(SlamSettings())
    off_m = off_height(Path(straight, across_deg=17.0, ground=ground), slam, 16.0, lambda _t: 0.0)
    assert np.abs(off_m).max() < 0.05
    assert abs(slam.height_drift_m) < 0.05


def test_the_autopilots_drift_is_learned_where_surfaces_hold_the_scan() -> None:
    slam = Slam(SlamSettings())
    fly(Path(leg), slam, 12.0, count=2500, drift=0.05)
    assert slam._odometry.state.autopilot_drift == pytest.approx([0.05, 0.0, 0.0], abs=0.015)


def test_a_vehicle_that_is_shaken_is_followed_by_its_scans() -> None:
    path, slam, rng = Path(leg, across_deg=17.0), Slam(SlamSettings()), np.random.default_rng(7)
    for k in range(40):
        end_s = (k + 1) / 10
        readings = [
            replace(reading, rates=reading.rates + rng.normal(0.0, 0.3, 3), specific_force=reading.specific_force + rng.normal(0.0, 3.0, 3))
            for reading in path.readings(k / 10, end_s, rng)
        ]
        slam.add(path.sweep(k / 10, seed=k, count=2500), readings, path.autopilot(end_s), np.eye(4))
        turn = slam.pose()[0][:3, :3] @ path.pose(end_s)[:3, :3].T
        assert np.degrees(Rotation.from_matrix(turn).magnitude()) < 2.0
        assert np.linalg.norm(slam.pose()[0][:3, 3] - path.position(end_s)) < 0.1
    assert slam.count.rejected == 0


def begin(t):
    """Stand for a second, then 1.2 m/s within a second."""
    faster = np.clip(t - 1.0, 0.0, 1.0)
    return np.array([0.6 * faster**2 + 1.2 * max(t - 2.0, 0.0), 0.0, 2.0])


def test_a_start_along_bare_walls_is_not_held_back_by_the_mean_velocity() -> None:
    slam = Slam(SlamSettings())
    assert fly(Path(begin, corridor=True, across_deg=30.0), slam, 3.0) < 0.02


def test_a_jump_of_the_autopilots_position_moves_odom_and_not_the_map() -> None:
    path, slam = Path(lap), Slam(SlamSettings())
    assert fly(path, slam, 4.0, jump_m=2.0, jump_s=2.5) < 0.1
    assert slam.T_map_odom[0, 3] == pytest.approx(-2.0, abs=0.15)


@pytest.mark.parametrize("path", [Path(lap), Path(leg, across_deg=17.0)], ids=["seen all around", "seen across the flight"])
def test_a_jump_of_the_autopilots_heading_turns_odom_and_not_the_map(path) -> None:
    slam, jumped, known_rad = Slam(SlamSettings()), np.radians([0.0, 0.0, 20.0]), np.radians(0.2)
    assert fly(path, slam, 3.2, count=2500, turned=lambda t: jumped * (t >= 2.5)) < 0.03
    assert Rotation.from_matrix(slam.pose()[0][:3, :3] @ path.pose(3.2)[:3, :3].T).magnitude() < known_rad
    assert Rotation.from_matrix(slam.T_map_odom[:3, :3]).as_rotvec() == pytest.approx(-jumped, abs=known_rad)
    assert slam.count.rejected == 0


@pytest.mark.parametrize("held", [1 << 40, 0], ids=["all in memory", "what lies behind in a file"])
def test_a_loop_is_closed_and_the_correction_carried_on_to_the_map(held, monkeypatch) -> None:
    monkeypatch.setattr("lidar_mapping.keyframes.MOST_HELD", held)
    slam = Slam(SlamSettings())
    path = Path(lap)
    assert fly(path, slam, 20.0) < 0.1
    before, shift = slam.loops, np.array([0.0, 0.5, 0.0])
    for frame in slam.keyframes.all[len(slam.keyframes.all) // 2 :]:  # as if the second half had drifted away
        frame.pose = frame.pose.copy()
        frame.pose[:3, 3] += shift
    drifted = np.eye(4)
    drifted[:3, 3] = shift
    slam._odometry.move(drifted)
    rng = np.random.default_rng(9)
    for k in range(200, 280):
        slam.add(path.sweep(k / 10, seed=k), path.readings(k / 10, k / 10 + 0.1, rng), path.autopilot(k / 10 + 0.1), np.eye(4))
    assert slam.loops > before
    pose, _ = slam.pose()
    assert pose[:3, 3] == pytest.approx(path.position(28.0), abs=0.15)


def test_of_a_sensor_of_many_beams_all_points_are_used_as_means() -> None:
    path, slam, inserted = Path(lap), Slam(SlamSettings(odometry=OdometrySettings(most_points=2000, dense_voxel_m=0.5))), []
    insert = slam.map.insert
    slam.map.insert = lambda points: inserted.append(points) or insert(points)
    for k in range(10):
        sweep = path.sweep(k / 10, seed=k)
        assert len(sweep.points) > 4000
        slam.add(sweep, path.readings(k / 10, k / 10 + 0.1, np.random.default_rng(k)), path.autopilot(k / 10 + 0.1), np.eye(4))
        assert len(inserted[-1]) < 0.8 * len(sweep.within(1.2, 25.0).points)
    assert np.linalg.norm(slam.pose()[0][:3, 3] - path.position(1.0)) < 0.05
    few = path.sweep(1.0, seed=1, count=1500)
    slam.add(few, path.readings(1.0, 1.1, np.random.default_rng(10)), path.autopilot(1.1), np.eye(4))
    assert len(inserted[-1]) == len(few.within(1.2, 25.0).points)


def test_along_a_street_of_64_beams_the_pose_hardly_drifts() -> None:
    drive, slam, off_m = Drive(street(240.0, 1), 1), Slam(SlamSettings(self_m=1.5, max_range_m=80.0)), []
    for number in range(1, 101):  # 80 m; the autopilot's way is too long by 2 %
        slam.add(drive.sweep(number), [], drive.poses(number, 0.02), np.eye(4))
        off_m.append(np.linalg.norm(slam.pose()[0][:3, 3] - drive.pose(number * PERIOD_S)[:3, 3]))
    assert slam.count.rejected == 0
    assert np.sqrt(np.mean(np.square(off_m))) < 0.025
    assert max(off_m) < 0.06


def test_a_corridor_makes_the_position_uncertain_along_it_and_is_survived() -> None:
    path = Path(lambda t: np.array([min(t, 6.0) * 0.8, 0.0, 2.0]), corridor=True)
    slam = Slam(SlamSettings())
    assert fly(path, slam, 5.0) < 0.6
    pose, covariance = slam.pose()
    assert pose[1:3, 3] == pytest.approx([0.0, 2.0], abs=0.03)
    to_keyframes = slam._odometry.filter.covariance
    assert np.sqrt(to_keyframes[6, 6]) > 10 * np.sqrt(to_keyframes[7, 7])
    assert np.sqrt(covariance[0, 0]) > 6 * np.sqrt(covariance[1, 1]), "what keyframes hand on is added in all directions"


def test_a_scan_that_fits_nowhere_is_not_inserted_and_seconds_of_it_are_a_lost_map() -> None:
    path, slam = Path(lap), Slam(SlamSettings())
    fly(path, slam, 1.0)
    points, rng = len(slam.map), np.random.default_rng(2)
    assert slam.problem == ""
    for k in range(10, 45):
        nonsense = path.sweep(k / 10, seed=k)
        nonsense = type(nonsense)(nonsense.stamp_ns, rng.uniform(-8, 8, nonsense.points.shape).astype(np.float32), nonsense.times_s)
        found = slam.add(nonsense, path.readings(k / 10, k / 10 + 0.1, rng), path.autopilot(k / 10 + 0.1), np.eye(4))
        assert not found.believed
    assert len(slam.map) == points
    assert "no scan fitted the map" in slam.problem
    slam.add(path.sweep(4.5, seed=45), path.readings(4.5, 4.6, rng), path.autopilot(4.6), np.eye(4))
    assert slam.problem == ""


def test_a_saved_map_is_gone_on_with() -> None:
    path, first, second = Path(lap), Slam(SlamSettings()), Slam(SlamSettings())
    fly(path, first, 3.0)
    second.resume(first.map.points)
    assert fly(path, second, 3.0) < 0.1
    assert len(second.map) < 1.3 * len(first.map)


def test_a_saved_map_is_gone_on_with_from_a_place_that_is_half_a_metre_off() -> None:
    path, first, second = Path(lap), Slam(SlamSettings()), Slam(SlamSettings())
    fly(path, first, 3.0)
    second.resume(first.map.points)
    second.T_map_odom[:2, 3] = [0.4, -0.3]
    assert fly(path, second, 0.1) < 0.05, "the first scan is laid onto the map at once"
    assert len(second.map) < 1.3 * len(first.map)


def test_a_sweep_without_pose_changes_nothing() -> None:
    slam = Slam(SlamSettings())
    with pytest.raises(PoseUnavailableError):
        slam.add(Path(lap).sweep(0.0, seed=1), [], PoseBuffer(), np.eye(4))
    assert (len(slam.map), slam.count.scans) == (0, 0)


@pytest.mark.parametrize("every_s", [0.01, 0.005])
def test_what_the_imu_felt_while_the_autopilot_was_silent_counts(every_s) -> None:
    """The link is lost for a second, in which the vehicle turns; the autopilot tells nothing of that, and the scans after it are thin."""
    path = Path(leg, yaw=lambda t: 0.25 * (1.0 - np.cos(np.pi * np.clip(t - 1.0, 0.0, 1.0))))
    slam, rng = Slam(SlamSettings()), np.random.default_rng(5)
    for k in range(22):
        start_s, end_s = k / 10, (k + 1) / 10
        readings = [path.reading(t, rng) for t in np.arange(start_s + every_s, end_s + every_s / 2, every_s)]
        silent = 1.0 < end_s < 2.0
        said = PoseBuffer() if silent else path.autopilot(end_s, turned=lambda t: np.array([0.0, 0.0, -0.5 if t > 1.5 else 0.0]))
        with pytest.raises(PoseUnavailableError) if silent else nullcontext():
            slam.add(path.sweep(start_s, seed=k, count=7000 if end_s < 1.5 else 30), readings, said, np.eye(4))
    turned = Rotation.from_matrix(path.pose(2.2)[:3, :3].T @ slam.pose()[0][:3, :3]).magnitude()
    assert turned < 0.02


def test_a_sweep_that_is_not_later_is_left_out_and_a_clock_that_was_set_back_is_followed() -> None:
    path, slam, rng = Path(lap), Slam(SlamSettings()), np.random.default_rng(2)
    fly(path, slam, 2.0)
    points = len(slam.map)
    found = slam.add(path.sweep(1.5, seed=1), [], path.autopilot(1.6), np.eye(4))
    assert (found.refusal, len(slam.map)) == ("the sweep is not later than the one before", points)
    for k in range(5):
        found = slam.add(path.sweep(k / 10, seed=k), path.readings(k / 10, k / 10 + 0.1, rng), path.autopilot(k / 10 + 0.1), np.eye(4))
        assert found.believed, found.refusal
    assert slam.pose()[0][:3, 3] == pytest.approx(path.position(0.5), abs=0.1)


def test_readings_that_can_not_be_any_are_left_out() -> None:
    queue, still, up = ReadingQueue(), np.zeros(3), np.array([0.0, 0.0, 9.81])
    assert queue.add(ImuReading(NS, still, up), NS)
    for wrong in (
        ImuReading(NS, still, up),  # again
        ImuReading(NS - 1, still, up),
        ImuReading(10 * NS, still, up),
        ImuReading(NS + 2, still + np.nan, up),
        ImuReading(NS + 2, still, up * 1e3),
    ):
        assert not queue.add(wrong, NS + 5)
    assert queue.add(ImuReading(NS + 3, still, up), NS + 5)
    assert [reading.stamp_ns for reading in queue.take_until(NS + 2)] == [NS, NS + 2]
    assert [reading.stamp_ns for reading in queue.take_until(2 * NS)] == [NS + 3]
    assert queue.add(ImuReading(2, still, up), 8), "the clock was set back"


def test_readings_in_g_are_left_out_and_a_moment_without_weight_is_not() -> None:
    queue = ReadingQueue()
    strengths = [9.81] * 50 + [0.5] * 25 + [9.81] * 50
    assert all(queue.add(ImuReading(k * NS // 50, np.zeros(3), np.array([0.0, 0.0, f])), 9 * NS) for k, f in enumerate(strengths))
    in_g = ReadingQueue()
    assert not any(in_g.add(ImuReading(k * NS // 50, np.zeros(3), np.array([0.0, 0.0, 1.0])), 9 * NS) for k in range(100))


def test_a_sweep_gets_the_reading_of_its_end_from_those_around_it() -> None:
    queue, up = ReadingQueue(), np.array([0.0, 0.0, 9.81])
    for k in range(1, 4):
        assert queue.add(ImuReading(k * NS // 50, np.full(3, k), up), NS)
    taken = queue.take_until(3 * NS // 100)
    assert [(reading.stamp_ns, reading.rates[0]) for reading in taken] == [(NS // 50, 1.0), (3 * NS // 100, 1.5)]
    assert [reading.stamp_ns for reading in queue.take_until(NS)] == [2 * NS // 50, 3 * NS // 50], "it is whole for the next sweep"
    assert queue.add(ImuReading(5 * NS, np.zeros(3), up), 5 * NS)
    assert queue.take_until(NS) == [], "a reading after a gap says nothing of the time before the gap"


def test_the_readings_of_a_sweep_are_waited_for_once_in_vain() -> None:
    queue, up = ReadingQueue(), np.array([0.0, 0.0, 9.81])
    late = Timer(0.2, lambda: queue.add(ImuReading(NS, np.zeros(3), up), NS))
    late.start()
    queue.wait_for(NS, 30.0)
    assert [reading.stamp_ns for reading in queue.take_until(NS)] == [NS]
    queue.wait_for(2 * NS, 0.01)
    waits = Thread(target=queue.wait_for, args=(3 * NS, 3600.0), daemon=True)
    waits.start()
    waits.join(30.0)
    assert not waits.is_alive(), "none has come since the last wait, which was in vain"
    late.join()
