"""The sensors see the world that is there, from where the vehicle is, the same for the same seed."""

import math

import cv2
import numpy as np
import open3d as o3d
import pytest

from alula.common.faults import parse_faults
from uav_simulator.errors import ConfigError
from uav_simulator.sensors import degradation
from uav_simulator.sensors.faults import AUTOPILOTS, FAULTS, SensorBoard, SensorMode
from uav_simulator.sensors.imu import Imu, ImuReading
from uav_simulator.sensors.lidar import Lidar
from uav_simulator.sensors.mounts import LIDAR, ZED_LEFT, rotation_matrix
from uav_simulator.sensors.pose_track import Pose, PoseTrack
from uav_simulator.sensors.stereo import StereoPair
from uav_simulator.sensors.texture import GRAINS, layer, noise_tiles
from uav_simulator.vehicle.quaternion import from_yaw, multiply
from uav_simulator.world.config import find_world, load_world
from uav_simulator.world.parts import build_parts
from uav_simulator.world.scene import Scene

CONFIG = load_world(find_world("yard"))
TILTED = multiply(from_yaw(0.3), (0.998, 0.04, -0.05, 0.0))


@pytest.fixture(scope="module")
def world():
    return Scene(build_parts(CONFIG, 0))


def pose(x, y, z, attitude, stamp_s=0.0):
    norm = float(np.linalg.norm(attitude))
    return Pose(stamp_s, (x, y, z), tuple(v / norm for v in attitude))


def matched_depth(pair, left, right):
    """Return the depth (m) that block matching finds, nan where it finds none."""
    matcher = cv2.StereoSGBM_create(0, 64, 5, P1=200, P2=800, uniquenessRatio=10, speckleWindowSize=100, speckleRange=2)
    disparity = matcher.compute(left, right).astype(np.float32) / 16.0
    with np.errstate(divide="ignore"):
        return np.where(disparity > 0.5, pair.camera.focal_px * pair.camera.baseline_m / disparity, np.nan)


def test_block_matching_finds_the_distance_of_a_known_wall(world):
    pair = StereoPair(world, 0)
    left, right = pair.render(pose(13.0, -2.0, 3.0, from_yaw(-np.pi / 2)))  # looks south at the wall whose face is at y = -4.3
    depth = matched_depth(pair, left, right)[110:160, 200:280]
    assert np.isfinite(depth).mean() > 0.9
    assert np.nanmedian(depth) == pytest.approx(4.3 - 2.0 - 0.25, rel=0.05)


def true_depth(world, pair, at):
    """Return the depth (m) of each pixel of the left image, each by a ray of its own."""
    cx, cy = pair.camera.centre_px
    u, v = np.meshgrid(np.arange(480), np.arange(270))
    directions = np.stack([(u - cx) / 240.0, (v - cy) / 240.0, np.ones_like(u, dtype=float)], axis=-1)
    body = rotation_matrix(at.attitude)
    rays = np.empty((270, 480, 6), dtype=np.float32)
    rays[..., :3] = np.array(at.position) + body @ np.array(ZED_LEFT.translation)
    rays[..., 3:] = directions @ (body @ ZED_LEFT.matrix).T
    return world.cast(rays).range_m


@pytest.mark.parametrize("shift_px", [-0.5, 0.0, 0.5])
def test_both_eyes_see_the_same_surface_at_its_true_disparity(world, shift_px):
    pair = StereoPair(world, 0)
    at = pose(2.0, 0.0, 3.0, TILTED)
    left, right = pair.render(at)
    depth = true_depth(world, pair, at)
    disparity = 240.0 * 0.12 / depth
    u, v = np.meshgrid(np.arange(480, dtype=np.float32), np.arange(270, dtype=np.float32))
    seen = cv2.remap(right, u - disparity + np.float32(shift_px), v, cv2.INTER_LINEAR).astype(float)
    near = (depth < 10.0) & (u - disparity > 2.0)
    difference = np.median(np.abs(seen - left)[near])
    assert (difference <= 2.5) == (shift_px == 0.0), "the pixel noise's size, and only at the true disparity"


def test_matched_disparities_agree_with_rays(world):
    pair = StereoPair(world, 0)
    at = pose(2.0, 0.0, 3.0, TILTED)
    matched, truth = matched_depth(pair, *pair.render(at)), true_depth(world, pair, at)
    near = np.isfinite(matched) & (truth < 10.0)
    assert near.sum() > 0.6 * (truth < 10.0).sum()
    error_px = 240.0 * 0.12 * (1.0 / matched - 1.0 / truth)[near]
    assert abs(np.median(error_px)) < 0.1
    assert np.mean(np.abs(error_px) < 0.5) > 0.9


def test_the_sky_has_no_depth(world):
    pair = StereoPair(world, 0)
    left, right = pair.render(pose(0.0, 0.0, 3.0, multiply(from_yaw(0.0), (np.cos(-0.6), 0.0, np.sin(-0.6), 0.0))))  # nose up
    depth = matched_depth(pair, left, right)[:60]
    assert np.isnan(depth).mean() > 0.95


def test_a_layer_of_noise_goes_on_beyond_its_tile_as_opencv_repeats_an_image():
    tile, grain = noise_tiles(0)[0], GRAINS[0]
    u, v = (np.random.default_rng(n).uniform(-200.0, 200.0, (135, 240)).astype(np.float32) for n in (1, 2))
    repeated = cv2.remap(tile[:-1, :-1], u * 40.0, v * 40.0, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP).astype(np.float32)
    whole = layer(tile, u, v, grain, np.zeros_like(u))
    assert np.array_equal(whole, (repeated - 128.0) * (grain.contrast / 128.0))
    coarse = np.full_like(u, 2.25 * grain.texel_m)
    assert np.allclose(layer(tile, u, v, grain, coarse), 0.5 * whole, atol=1e-4)
    assert not layer(tile, u, v, grain, 2.0 * coarse).any(), "what is finer than a pixel is faded out"


def track_of(*poses):
    track = PoseTrack()
    for p in poses:
        track.add(p)
    return track


def in_map(points, positions, rotations):
    local = np.stack([points["x"], points["y"], points["z"]], axis=1).astype(np.float64)
    body = local @ LIDAR.matrix.T + np.array(LIDAR.translation)
    return np.einsum("nij,nj->ni", rotations, body) + positions


def test_lidar_points_lie_on_the_surfaces_also_when_the_vehicle_moves(world):
    lidar = Lidar(world, 0)
    track = track_of(*[pose(2.0 + 5.0 * t, 0.3 * t, 3.0, multiply(from_yaw(2.0 * t), TILTED), t) for t in np.arange(0.0, 0.13, 0.02)])
    points = lidar.scan(track, 0.0)
    assert len(points) > 4000
    surface = o3d.t.geometry.RaycastingScene()
    surface.add_triangles(o3d.core.Tensor(world.vertices.astype(np.float32)), o3d.core.Tensor(world.triangles.astype(np.uint32)))

    def distances(times):
        cloud = in_map(points, *track.at(times)).astype(np.float32)
        return surface.compute_distance(o3d.core.Tensor(cloud)).numpy()

    moving = distances(points["time"].astype(np.float64))
    assert np.mean(moving < 3 * 0.02) > 0.99
    assert moving.max() < 5 * 0.02
    assert np.mean(distances(np.zeros(len(points))) < 3 * 0.02) < 0.9, "without each point's own time they would not"


def test_the_lidar_scans_across_the_direction_of_flight(world):
    lidar = Lidar(world, 0)
    points = lidar.scan(track_of(pose(8.0, 0.0, 3.0, from_yaw(0.0))), 0.0)
    ranges = np.sqrt(points["x"] ** 2 + points["y"] ** 2 + points["z"] ** 2)
    assert np.abs(np.degrees(np.arcsin(points["z"] / ranges))).max() == pytest.approx(15.0, abs=0.1)
    assert (points["x"] > 2.0).any()
    assert (points["x"] < -2.0).any(), "surfaces on both sides"
    assert ranges.max() <= 25.2
    assert 0.0 <= points["time"].min() < points["time"].max() < 0.1


def test_pose_track_interpolates_through_the_sign_flip_of_quaternions():
    a, b = from_yaw(3.0), from_yaw(3.4)
    track = track_of(Pose(0.0, (0.0, 0.0, 0.0), a), Pose(1.0, (2.0, 0.0, 0.0), tuple(-v for v in b)))
    positions, rotations = track.at(np.array([0.5]))
    assert positions[0] == pytest.approx((1.0, 0.0, 0.0))
    assert rotations[0] == pytest.approx(rotation_matrix(from_yaw(3.2)), abs=1e-3)


def test_the_same_seed_sees_the_same_and_another_does_not(world):
    at = pose(4.0, 0.0, 3.0, from_yaw(0.0))
    shots = [StereoPair(world, seed).render(at)[0] for seed in (7, 7, 8)]
    assert np.array_equal(shots[0], shots[1])
    assert not np.array_equal(shots[0], shots[2])
    sweeps = [Lidar(world, seed).scan(track_of(at), 0.0) for seed in (7, 7, 8)]
    assert np.array_equal(sweeps[0], sweeps[1])
    assert len(sweeps[0]) != len(sweeps[2]) or not np.array_equal(sweeps[0], sweeps[2])
    readings = [Imu(seed).measure((0.0, 0.0, 0.0), (0.0, 0.0, 9.8)) for seed in (7, 7, 8)]
    assert readings[0] == readings[1] != readings[2]


def test_imu_noise_has_its_size():
    imu = Imu(0)
    x = np.array([imu.measure((0.1, 0.0, 0.0), (0.0, 0.0, 9.8)).rates[0] for _ in range(2000)])
    assert x.std() == pytest.approx(0.003, rel=0.1)
    assert x.mean() == pytest.approx(0.1, abs=0.005)


def test_on_the_ground_the_sensors_see_the_world_and_not_the_ground_from_inside(world):
    standing = pose(0.0, 0.0, 0.0, from_yaw(0.0))
    left, right = StereoPair(world, 0).render(standing)
    assert min(left.std(), right.std()) > 25.0
    track = PoseTrack()
    for n in range(8):
        track.add(pose(0.0, 0.0, 0.0, from_yaw(0.0), 0.02 * n))
    points = Lidar(world, 0).scan(track, 0.02)
    up = np.array([points[axis] for axis in "xyz"]).T @ LIDAR.matrix.T[:, 2]
    assert up.max() > 2.0, "walls"
    assert np.abs(up[up < 0.1]).max() < 0.2, "the ground is right below"


# --- faults --------------------------------------------------------------------------------------------------------------


GREY = np.random.default_rng(0).integers(40, 200, (2, 270, 480), dtype=np.uint8)
SOFT = tuple(cv2.GaussianBlur(eye, (0, 0), 1.5) for eye in GREY)


def broken(mode):
    return degradation.pair(mode, SOFT, np.random.default_rng(1))


def test_every_way_of_failing_is_a_mode_and_changes_what_it_is_for():
    assert {mode for ways in FAULTS.values() for mode in ways} == {mode.value for mode in SensorMode} - {"ok"}
    images = {mode: broken(SensorMode(mode)) for mode in FAULTS["zed"]}
    same = {mode for mode, pair in images.items() if all(np.array_equal(a, b) for a, b in zip(pair, SOFT, strict=True))}
    assert same == {"dead", "frozen", "late", "future", "wrong_info"}, "these are the driver's"


def test_light_and_sharpness_fail_as_they_are_named():
    assert broken(SensorMode.BLACK)[0].max() == 0
    dark, white, blurred = (broken(mode)[0] for mode in (SensorMode.DARK, SensorMode.WHITE, SensorMode.BLURRED))
    assert 0.0 < dark.std() < 5.0
    assert dark.mean() < 8.0
    assert (white == 255).mean() > 0.9
    sharpness = [cv2.Laplacian(eye, cv2.CV_64F).var() for eye in (SOFT[0], blurred)]
    assert sharpness[1] < 0.05 * sharpness[0]


def test_the_right_eye_moves_as_it_is_named():
    left, right = broken(SensorMode.SHIFTED)
    assert np.array_equal(left, SOFT[0])
    assert np.array_equal(right[3:], SOFT[1][:-3])
    assert np.array_equal(broken(SensorMode.SWAPPED)[0], SOFT[1])
    turned = broken(SensorMode.ROTATED)[1]
    across = math.tan(math.radians(1.0)) * 200.0  # so many pixels up, 200 pixels right of the centre
    column, row = 240 + 200, 135 - round(across)
    patch = SOFT[1][125:146, 430:451].astype(float) - SOFT[1][125:146, 430:451].mean()
    found = turned[row - 10 : row + 11, column - 10 : column + 11].astype(float)
    assert np.corrcoef(patch.ravel(), (found - found.mean()).ravel())[0, 1] > 0.7
    flickering = [degradation.pair(SensorMode.FLICKERING, SOFT, np.random.default_rng(n))[0] for n in range(2)]
    assert np.count_nonzero(flickering[0] != flickering[1]) == 1


def test_the_lidar_fails_as_it_is_named(world):
    track = PoseTrack()
    for n in range(8):
        track.add(pose(10.0, 0.0, 3.0, from_yaw(0.0), 0.02 * n))
    good = Lidar(world, 0).scan(track, 0.02)
    sweep = {mode: degradation.sweep(SensorMode(mode), good, np.random.default_rng(1)) for mode in FAULTS["lidar"]}
    assert len(sweep["black"]) == 0
    assert 1 / 550 < len(sweep["thinned"]) / len(good) < 1 / 450
    body = np.array([sweep["sector"][axis] for axis in "xyz"]).T @ LIDAR.matrix.T
    assert 0.3 < len(body) / len(good) < 0.7
    assert body[:, 0].max() < 0.0
    length = [np.linalg.norm([points[axis] for axis in "xyz"], axis=0) for points in (good, sweep["biased"])]
    assert np.allclose(length[1] - length[0], 0.5, atol=1e-3)
    assert np.array_equal(sweep["flickering"]["x"], good["x"])
    assert sweep["flickering"]["intensity"][0] != good["intensity"][0]
    assert sweep["frozen"] is good


def test_the_imu_fails_as_it_is_named():
    good = ImuReading((0.1, 0.2, 0.3), (0.0, 0.0, 9.8))
    biased = degradation.inertial(SensorMode.BIASED, good, np.random.default_rng(1))
    assert math.dist(biased.rates, good.rates) == pytest.approx(0.088, abs=0.001)
    assert math.dist(biased.specific_force, good.specific_force) == pytest.approx(0.877, abs=0.001)
    assert degradation.inertial(SensorMode.BLACK, good, np.random.default_rng(1)) == ImuReading((0.0,) * 3, (0.0,) * 3)


@pytest.mark.parametrize(
    ("sensor", "mode", "said"), [("sonar", "ok", "'sonar'; known are zed"), ("imu", "white", "imu has no mode 'white'; it has ok")]
)
def test_a_wrong_mode_is_refused(sensor, mode, said):
    with pytest.raises(ConfigError, match=said):
        SensorBoard([]).set(sensor, mode, 0.0)


@pytest.mark.parametrize("what", AUTOPILOTS)
def test_what_belongs_to_an_autopilot_that_is_not_simulated_can_not_be_broken(what):
    faults = parse_faults(f"{what}@3", FAULTS)
    assert SensorBoard(faults).modes[what] == "ok"
    with pytest.raises(ConfigError, match=f"no fault of the {what}: it is the autopilot's, which is not simulated; "):
        SensorBoard(faults, absent=AUTOPILOTS)
    with pytest.raises(ConfigError, match=f"no fault of the {what}: it is the autopilot's"):
        SensorBoard([], absent=AUTOPILOTS).set(what, FAULTS[what][0], 0.0)


def test_scheduled_faults_happen_at_their_moment_after_lift_off():
    board = SensorBoard(parse_faults("zed@3,imu", FAULTS))
    assert board.apply_due(0.0, None)
    assert board.modes == {**dict.fromkeys(FAULTS, "ok"), "imu": "dead"}
    assert not board.apply_due(100.0, None), "not lifted off yet"
    assert not board.apply_due(12.9, 10.0)
    assert board.apply_due(13.0, 10.0)
    assert not board.apply_due(13.1, 10.0)
    board.set("zed", "ok", 20.0)
    assert [(r.sensor, r.mode.value, r.t_s) for r in board.records] == [("imu", "dead", 0.0), ("zed", "dead", 13.0), ("zed", "ok", 20.0)]


def test_a_fault_with_an_end_is_mended():
    board = SensorBoard(parse_faults("zed:dark@3-5", FAULTS))
    modes = [(t, board.apply_due(10.0 + t, 10.0), board.mode("zed")) for t in (0.0, 3.0, 4.9, 5.0)]
    assert modes == [(0.0, False, SensorMode.OK), (3.0, True, SensorMode.DARK), (4.9, False, SensorMode.DARK), (5.0, True, SensorMode.OK)]
