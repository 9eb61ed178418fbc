"""What pairs tell of the rig: each way to be broken without being silent, on a real pair when it is at hand, and no false alarm."""

from __future__ import annotations

import os
from pathlib import Path

import cv2
import numpy as np
import pytest

from perception_core import NS, FaultKind, Verdict
from perception_core.testing import wall_pair
from zed_depth import StereoPair, StereoRig, ZedSettings
from zed_depth.fixed_columns import fixed_columns_finding

ROOT = Path(__file__).resolve().parents[4]
DATA = Path(os.environ.get("ALULA_DATA", ROOT.parent / "shared" / "data")) / "stereo_motorcycle"


def noisy(image, seed, sigma=1.5) -> np.ndarray:
    return np.clip(image + np.random.default_rng(seed).normal(0, sigma, image.shape), 0, 255).astype(np.uint8)


def shifted(image, rows) -> np.ndarray:
    return np.roll(image, rows, axis=0)


def turned(image, degrees) -> np.ndarray:
    height, width = image.shape
    matrix = cv2.getRotationMatrix2D((width / 2, height / 2), degrees, 1.0)
    return cv2.warpAffine(image, matrix, (width, height), borderMode=cv2.BORDER_REPLICATE)


def blurred(image) -> np.ndarray:
    return cv2.GaussianBlur(image, (0, 0), 3.0)


def zoomed(image) -> np.ndarray:
    height, width = image.shape
    matrix = cv2.getRotationMatrix2D((width / 2, height / 2), 0.0, 1.03)
    return cv2.warpAffine(image, matrix, (width, height), borderMode=cv2.BORDER_REPLICATE)


def flickering(image, seed) -> np.ndarray:
    again = image.copy()
    again[12, 12] = seed % 256
    return again


def covered(image, begin, end) -> np.ndarray:
    """Return the image of a lens that a finger covers between two shares of its width."""
    columns = np.linspace(0.0, 1.0, image.shape[1])
    free = 1.0 - 1.0 / (1.0 + np.exp((begin - columns) / 0.02)) / (1.0 + np.exp((columns - end) / 0.02))
    return image * free + 40.0 * (1.0 - free)


BROKEN, UNKNOWN = Verdict.BROKEN, Verdict.UNKNOWN
# name: (what becomes of the pair, with a seed for each; verdict; fault; words of the sentence)
BREAKS = {
    "shifted 3 px": (
        lambda a, b, s: (noisy(a, s), noisy(shifted(b, 3), s + 1)),
        BROKEN,
        FaultKind.CALIBRATION,
        "px off the left one's rows",
    ),
    "turned 1 degree": (
        lambda a, b, s: (noisy(a, s), noisy(turned(b, 1.0), s + 1)),
        BROKEN,
        FaultKind.CALIBRATION,
        "turned against each other",
    ),
    "zoomed 3 %": (
        lambda a, b, s: (noisy(a, s), noisy(zoomed(b), s + 1)),
        BROKEN,
        FaultKind.CALIBRATION,
        "or one image is older than the other",
    ),
    "swapped": (lambda a, b, s: (noisy(b, s), noisy(a, s + 1)), BROKEN, FaultKind.CALIBRATION, "left and right are swapped"),
    "both mirrored": (
        lambda a, b, s: (noisy(a[:, ::-1], s), noisy(b[:, ::-1], s + 1)),
        BROKEN,
        FaultKind.CALIBRATION,
        "left and right are swapped, as both images are when they are mirrored or upside down",
    ),
    "both upside down": (
        lambda a, b, s: (noisy(a[::-1, ::-1], s), noisy(b[::-1, ::-1], s + 1)),
        BROKEN,
        FaultKind.CALIBRATION,
        "left and right are swapped, as both images are when they are mirrored or upside down",
    ),
    "doubled": (lambda a, b, s: (noisy(a, s), noisy(a, s)), BROKEN, FaultKind.VIEW, "both cameras deliver the same image"),
    "doubled, with noise": (lambda a, b, s: (noisy(a, s), noisy(a, s + 1)), UNKNOWN, FaultKind.VIEW, "no parallax"),
    "unrelated": (lambda a, b, s: (noisy(a, s), noisy(b[:, ::-1], s + 1)), BROKEN, FaultKind.VIEW, "do not see the same scene"),
    "one blurred": (lambda a, b, s: (noisy(a, s), noisy(blurred(b), s + 1)), BROKEN, FaultKind.BLUR, "right image is blurred"),
    "both blurred": (lambda a, b, s: (noisy(blurred(a), s), noisy(blurred(b), s + 1)), BROKEN, FaultKind.BLUR, "left image is blurred"),
    "dark, with noise": (lambda a, b, s: (noisy(a * 0.02, s, 5), noisy(b * 0.02, s + 1, 5)), BROKEN, FaultKind.EXPOSURE, "is dark"),
    "black": (lambda a, b, s: (a * 0, b * 0), BROKEN, FaultKind.EXPOSURE, "left image is dark"),
    "blank": (lambda a, b, s: (noisy(a, s), noisy(b * 0 + 128, s + 1)), BROKEN, FaultKind.EXPOSURE, "right image is blank"),
    "both blank": (
        lambda a, b, s: (noisy(a * 0 + 128, s), noisy(b * 0 + 128, s + 1)),
        UNKNOWN,
        FaultKind.EXPOSURE,
        "both images are blank: a surface without texture",
    ),
    "half of a lens covered": (
        lambda a, b, s: (noisy(a, s), noisy(covered(b, -1.0, 0.5), s + 1)),
        BROKEN,
        FaultKind.VIEW,
        "the right camera sees nothing where the other one does",
    ),
    "the middle of a lens covered": (
        lambda a, b, s: (noisy(covered(a, 0.25, 0.75), s), noisy(b, s + 1)),
        BROKEN,
        FaultKind.VIEW,
        "the left camera sees nothing where the other one does",
    ),
    "overexposed": (lambda a, b, s: (noisy(a * 8.0, s), noisy(b * 8.0, s + 1)), BROKEN, FaultKind.EXPOSURE, "overexposed"),
    "frozen": (lambda a, b, s: (a, b), BROKEN, FaultKind.FROZEN, "left image is frozen"),
    "frozen but for a pixel": (lambda a, b, s: (noisy(a, s), flickering(b, s)), BROKEN, FaultKind.FROZEN, "right image is frozen"),
}


@pytest.mark.parametrize(("begin", "end"), [(-1.0, 0.33), (0.25, 0.75), (0.6, 2.0)])
@pytest.mark.parametrize("side", [0, 1])
def test_a_covered_part_of_a_lens_is_known_before_surfaces_of_little_texture(side, begin, end) -> None:
    shade = 25.0 * np.sin(np.linspace(0.0, 7.0, 480))
    pale = [150.0 + shade + 0.2 * (image - 120.0) for image in wall_pair(9.5, seed=1)]
    rig = rig_for(pale[0], 240.0)
    sky = np.where(np.arange(270) < 90, 300.0, 0.0)[:, None]  # brighter than can be shown
    for k, gains in enumerate(((1.0, 1.0), (1.0, 0.7), (0.6, 1.0))):
        left, right = (gain * (image + sky) for gain, image in zip(gains, pale, strict=True))
        good = rig.finding(StereoPair(k * NS // 2, noisy(left, k), noisy(right, 20 + k)))
        assert good.ok, good.reason
    pale[side] = covered(pale[side], begin, end)
    for k in range(3, 6):
        found = rig.finding(StereoPair(k * NS // 2, noisy(pale[0], k), noisy(pale[1], 20 + k)))
    assert (found.verdict, found.fault) == (BROKEN, FaultKind.VIEW)
    assert "covered" in found.reason


class Scene:
    """A pair without noise, and the pairs that good cameras send of it: made once for all tests."""

    def __init__(self, left, right, fx: float) -> None:
        self.left, self.right, self.fx = left, right, fx
        self._good: dict[int, tuple[np.ndarray, np.ndarray]] = {}

    def good(self, k: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the k-th pair with its noise."""
        if k not in self._good:
            self._good[k] = noisy(self.left, 90 + k), noisy(self.right, 190 + k)
        return self._good[k]

    def rig(self) -> StereoRig:
        return rig_for(self.left, self.fx)


def scenes():
    yield pytest.param(Scene(*wall_pair(9.5, seed=1), 240.0), id="wall")
    if DATA.exists():
        images = (cv2.imread(str(DATA / f"motorcycle_{side}.png"), cv2.IMREAD_GRAYSCALE) for side in ("left", "right"))
        half = (cv2.resize(image, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA) for image in images)
        yield pytest.param(Scene(*half, 124.0), id="motorcycle")
    else:
        yield pytest.param(None, id="motorcycle", marks=pytest.mark.skip(reason=f"no real data at {DATA}: set ALULA_DATA"))


SCENES = tuple(scenes())


def rig_for(image, fx) -> StereoRig:
    from test_zed_depth_calibration import info

    rig = StereoRig(ZedSettings())
    height, width = image.shape
    for side in ("left", "right"):
        rig.take_info(side, info(right=side == "right", width=width, height=height, fx=fx, cx=width / 2, cy=height / 2))
    return rig


@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("name", BREAKS)
def test_a_broken_rig_is_known_within_half_a_second(scene, name) -> None:
    change, verdict, fault, sentence = BREAKS[name]
    rig = scene.rig()
    for k in range(3):
        assert rig.finding(StereoPair(k * NS // 10, *scene.good(k))).ok
    during = [rig.finding(StereoPair((3 + k) * NS // 10, *change(scene.left, scene.right, 300 + 2 * k))) for k in range(7)]
    assert all(finding.verdict is verdict for finding in during[4:]), [finding.reason for finding in during]
    assert {finding.fault for finding in during[4:]} == {fault}
    assert sentence in during[-1].reason
    after = [rig.finding(StereoPair((20 + k) * NS // 10, *scene.good(k))) for k in range(3)]
    assert all(finding.ok for finding in after)


def gained(image, gain) -> np.ndarray:
    return np.clip(image.astype(float) * gain, 0, 255)


def compressed(image, quality) -> np.ndarray:
    written = cv2.imencode(".jpg", np.clip(image, 0, 255).astype(np.uint8), [cv2.IMWRITE_JPEG_QUALITY, quality])[1]
    return cv2.imdecode(written, cv2.IMREAD_GRAYSCALE)


def dead(image) -> np.ndarray:
    return np.where(np.arange(image.shape[1]) % 8 == 0, 0, image)


def lower(image, other) -> np.ndarray:
    """Return the image with its lower half from another one."""
    return np.where(np.arange(image.shape[0])[:, None] < image.shape[0] // 2, image, other)


def earlier(image) -> np.ndarray:
    """Return what the camera saw before the vehicle turned a little."""
    return np.roll(image, (3, 25), axis=(0, 1))


# name: what becomes of the pair, with a seed for each; the sentence depends on the scene
MISFITS = {
    "right exposure doubled": lambda a, b, s: (noisy(a, s), noisy(gained(b, 2.2), s + 1)),
    "rows 2 px off": lambda a, b, s: (noisy(a, s), noisy(shifted(b, 2), s + 1)),
    "noise of 40 grey levels": lambda a, b, s: (noisy(a, s, 40), noisy(b, s + 1, 40)),
    "every 8th column of one image dead": lambda a, b, s: (noisy(a, s), dead(noisy(b, s + 1))),
    "every 8th column of both dead": lambda a, b, s: (dead(noisy(a, s)), dead(noisy(b, s + 1))),
    "compressed to blocks": lambda a, b, s: (compressed(noisy(a, s), 3), compressed(noisy(b, s + 1), 3)),
    "the lower halves black": lambda a, b, s: (lower(noisy(a, s), 0), lower(noisy(b, s + 1), 0)),
    "the lower half of one black": lambda a, b, s: (noisy(a, s), lower(noisy(b, s + 1), 0)),
}


@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("name", MISFITS)
@pytest.mark.parametrize("since_check", [0, 2])
def test_whatever_makes_the_images_differ_is_broken_and_no_pair_of_it_is_believed(scene, name, since_check) -> None:
    rig = scene.rig()
    good = 5 + since_check
    assert all(believed(rig, k, *scene.good(k)) for k in range(good))
    for k in range(8):
        left, right = (np.ascontiguousarray(image, dtype=np.uint8) for image in MISFITS[name](scene.left, scene.right, 300 + 2 * k))
        pair = StereoPair((good + k) * NS // 10, left, right)
        found = rig.finding(pair)
        assert not found.ok or rig.depth(pair).doubt, k
        if k > 0:
            assert found.verdict is BROKEN, k
    after = [believed(rig, 20 + k, *scene.good(k)) for k in range(6)]  # the noise is measured anew within five
    assert after[-2:] == [True, True]


@pytest.mark.parametrize("scene", SCENES)
def test_a_half_of_one_image_that_is_old_is_never_believed(scene) -> None:
    rig = scene.rig()
    assert all(believed(rig, k, *scene.good(k)) for k in range(5))
    for k in range(5, 12):
        left, right = scene.good(k)
        assert not believed(rig, k, left, np.ascontiguousarray(lower(right, earlier(right)))), k


def smooth_wall() -> Scene:
    """Return a scene without the wall's finest texture, in which a seam would be lost."""
    small = (image[:68, :120] for image in wall_pair(2.4, seed=1))
    return Scene(*(cv2.resize(image, (480, 272), interpolation=cv2.INTER_CUBIC) for image in small), 240.0)


@pytest.mark.parametrize("scene", [pytest.param(smooth_wall(), id="wall"), SCENES[1]])
def test_images_that_are_displaced_by_some_bytes_are_known_by_their_seam(scene) -> None:
    displaced = [np.roll(image.reshape(-1), 100).reshape(image.shape) for image in scene.good(0)]
    assert fixed_columns_finding(*scene.good(0)).ok
    found = fixed_columns_finding(*displaced)
    assert (found.verdict, found.fault) == (BROKEN, FaultKind.FORMAT)
    assert "both images have a step in column 100" in found.reason


@pytest.mark.parametrize("width", [8, 12, 30])
@pytest.mark.parametrize("brighter", [False, True])
def test_edges_of_a_post_that_meet_in_a_column_are_of_the_scene(width, brighter) -> None:
    """A post as wide as its disparity: its left edge in the left image is where its right edge is in the right one, at any distance."""
    left, right = (image.copy() for image in wall_pair(2.4, seed=1))
    grains = np.random.default_rng(4).normal(0.0, 1.0, (34, 60))
    post = cv2.resize(grains, (width, 270), interpolation=cv2.INTER_LINEAR) * 20.0 + (225.0 if brighter else 30.0)
    for image, begin in ((left, 200), (right, 200 - width)):
        image[:, begin : begin + width] = np.clip(post, 0, 255)
    pair = noisy(left, 5), noisy(right, 6)
    assert fixed_columns_finding(*pair).ok
    dead_column = [np.where(np.arange(480) == 100, 0, image).astype(np.uint8) for image in pair]
    assert "in column 10" in fixed_columns_finding(*dead_column).reason, "beside what is of the scene"


def far_and_near(shift_px) -> tuple[np.ndarray, np.ndarray]:
    """Return a pair whose upper third is far away, at 0.6 px, the right camera turned aside by some pixels."""
    (left, far), (_, near) = wall_pair(0.6, seed=1), wall_pair(9.5, seed=1)
    right = np.where(np.arange(270)[:, None] < 90, far, near)
    moved = np.array([[1.0, 0.0, shift_px], [0.0, 1.0, 0.0]])
    return left, cv2.warpAffine(right, moved, (480, 270), borderMode=cv2.BORDER_REPLICATE)


@pytest.mark.parametrize("shift_px", [2.0, 4.0, 8.0])
def test_a_camera_that_is_turned_aside_is_known_by_what_is_beyond_infinity(shift_px) -> None:
    left, right = far_and_near(0.0)
    rig = rig_for(left, 240.0)
    assert all(rig.finding(StereoPair(k * NS // 2, noisy(left, k), noisy(right, 50 + k))).ok for k in range(4))
    knocked = far_and_near(shift_px)[1]
    found = [rig.finding(StereoPair(k * NS // 2, noisy(left, k), noisy(knocked, 50 + k))) for k in range(4, 8)]
    assert {(finding.verdict, finding.fault) for finding in found} == {(BROKEN, FaultKind.CALIBRATION)}
    assert "turned aside against each other" in found[-1].reason


def test_what_the_images_tell_is_known_without_depths_being_asked_for() -> None:
    left, right = wall_pair(9.5, seed=1)
    rig = rig_for(left, 240.0)
    assert rig.finding(StereoPair(0, left, right)).ok
    noise = [StereoPair((1 + k) * NS // 10, noisy(left, k, 40), noisy(right, 90 + k, 40)) for k in range(6)]
    assert [rig.finding(pair).ok for pair in noise][4:] == [False, False]


@pytest.mark.parametrize(("width", "height"), [(1280, 720), (1920, 1080)])
def test_a_blur_of_3_px_of_the_matched_image_is_known_in_large_images(width, height) -> None:
    fine = [cv2.resize(image, (width, height), interpolation=cv2.INTER_CUBIC) for image in wall_pair(9.5, seed=1)]
    rig = rig_for(fine[0], width / 2.0)
    assert rig.finding(StereoPair(0, noisy(fine[0], 1), noisy(fine[1], 2))).ok
    soft = [cv2.GaussianBlur(image, (0, 0), 3.0 * round(width / 640)) for image in fine]
    found = rig.finding(StereoPair(NS // 2, noisy(soft[0], 3), noisy(soft[1], 4)))
    assert (found.verdict, found.fault) == (BROKEN, FaultKind.BLUR)


def tiled_pair(disparity_px: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the left and right image (270, 480) of a wall of equal tiles, a little aslant: each corner looks like all others."""
    tile = np.full((88, 88), 170, np.float32)
    tile[:3], tile[:, :3] = 60, 60
    wall = np.tile(tile, (20, 30))
    grains = np.random.default_rng(seed).normal(0, 1.5, (2, 270, 480))
    images = []
    for shift, grain in zip((0.0, disparity_px), grains, strict=True):
        seen = np.array([[0.2575, 0.02, -shift - 40.0], [0.01, 0.25, -40.0]])
        images.append(np.clip(cv2.warpAffine(wall, seen, (480, 270), flags=cv2.INTER_AREA) + grain, 0, 255).astype(np.uint8))
    return images[0], images[1]


def test_texture_that_repeats_is_no_other_scene_and_hides_no_fault() -> None:
    rig = rig_for(np.zeros((270, 480)), 240.0)

    def finding(k, left, right):
        return rig.finding(StereoPair(k * NS // 2, left, right))

    for k, gain in enumerate((1.0, 0.7, 1.3)):  # of the right eye
        left, right = tiled_pair(9.5, k)
        good = finding(k, left, noisy(gain * right, k))
        assert good.ok, good.reason
    left, right = tiled_pair(9.5, 3)
    off = finding(3, left, shifted(right, 3))
    assert (off.verdict, off.fault) == (BROKEN, FaultKind.CALIBRATION)
    left, right = tiled_pair(9.5, 4)
    strange = finding(4, left, wall_pair(9.5, seed=4)[1])
    assert (strange.verdict, strange.fault) == (BROKEN, FaultKind.VIEW)
    assert "do not see the same scene" in strange.reason


@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize(("shift_px", "found"), [(0.0, False), (0.4, False), (-0.4, False), (1.0, True), (-1.0, True)])
def test_rows_that_are_off_by_a_pixel_are_found_and_by_less_than_half_a_pixel_borne(scene, shift_px, found) -> None:
    """3 rows of a camera of 1920 px are 1 of the image that is matched."""
    moved = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, shift_px]])
    height, width = scene.right.shape
    right = cv2.warpAffine(scene.right.astype(np.float32), moved, (width, height), borderMode=cv2.BORDER_REPLICATE, flags=cv2.INTER_CUBIC)
    rig = scene.rig()
    told = [rig.finding(StereoPair(k * NS // 2, noisy(scene.left, k), noisy(right, 50 + k))) for k in range(4)]
    assert {finding.fault for finding in told} == {FaultKind.CALIBRATION if found else FaultKind.NONE}, [each.reason for each in told]


def believed(rig, k, left, right) -> bool:
    """Return whether the node would call a corridor free by this pair, if nothing is seen in it."""
    pair = StereoPair(k * NS // 10, left, right)
    return rig.finding(pair).ok and not rig.depth(pair).doubt


@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("name", BREAKS)
@pytest.mark.parametrize("since_check", [0, 2])
def test_no_pair_of_a_broken_rig_is_believed_wherever_it_falls_between_two_checks(scene, name, since_check) -> None:
    rig = scene.rig()
    good = 5 + since_check  # both images are held against each other at 0, 4, 8: three pairs or one before the next time
    for k in range(good):
        assert believed(rig, k, *scene.good(k)), k
    change = BREAKS[name][0]
    last = scene.good(good - 1) if name.startswith("frozen") else (scene.left, scene.right)
    broken = [change(*last, 300 + 2 * k) for k in range(6)]
    assert [k for k, pair in enumerate(broken) if believed(rig, good + k, *pair)] == []
    after = [believed(rig, 20 + k, *scene.good(k)) for k in range(4)]
    assert after[-2:] == [True, True]


def test_a_scene_with_less_depth_is_in_doubt_until_both_images_were_held_against_each_other() -> None:
    left, right = wall_pair(9.5, seed=1)
    rig = rig_for(left, 240.0)
    sky = noisy(np.full_like(left, 190), 7)
    half = [np.where(np.arange(270)[:, None] < 135, sky, image) for image in (left, right)]
    assert believed(rig, 0, left, right)
    assert believed(rig, 1, noisy(left, 1), noisy(right, 2))
    pair = StereoPair(2 * NS // 10, noisy(half[0], 3), noisy(half[1], 4))
    assert rig.finding(pair).ok
    assert rig.depth(pair).doubt.startswith("only 4")
    late = StereoPair(NS // 10 + NS // 20, noisy(half[0], 5), noisy(half[1], 6))  # judged before the doubt was known
    assert rig.depth(late).doubt == ""  # after the clock went back, earlier pairs do not count
    assert believed(rig, 3, noisy(half[0], 7), noisy(half[1], 8))
    assert believed(rig, 4, noisy(half[0], 9), noisy(half[1], 10))


@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("gain", [0.3, 0.6, 1.0, 1.4])
def test_a_good_rig_is_never_suspected(scene, gain) -> None:
    left, right = (np.clip(image * gain, 0, 255) for image in (scene.left, scene.right))
    rig = scene.rig()
    findings = [rig.finding(StereoPair(k * NS // 2, noisy(left, 2 * k), noisy(right, 2 * k + 1))) for k in range(6)]
    assert all(finding.ok for finding in findings), [finding.reason for finding in findings]


def test_without_camera_info_nothing_is_known_and_wrong_info_is_told() -> None:
    from test_zed_depth_calibration import info

    left, right = wall_pair(9.5, seed=1)
    rig = StereoRig(ZedSettings())
    unknown = rig.finding(StereoPair(0, left, right))
    assert (unknown.verdict, unknown.fault, unknown.reason) == (UNKNOWN, FaultKind.INFO, "no camera_info of both sides yet")
    for side in ("left", "right"):
        rig.take_info(side, info(right=side == "right", width=960, height=540, fx=480, cx=480, cy=270))
    finding = rig.finding(StereoPair(NS, noisy(left, 1), noisy(right, 2)))
    assert (finding.verdict, finding.fault) == (BROKEN, FaultKind.INFO)
    assert finding.reason == "camera_info is for 960x540 images, the left image is 480x270"
    for side in ("left", "right"):
        rig.take_info(side, info(right=side == "right", P=[0.0] * 12))
    assert "the camera is not calibrated" in rig.finding(StereoPair(2 * NS, noisy(left, 3), noisy(right, 4))).reason


def test_pairs_without_any_depth_are_unknown_until_there_is_one_again() -> None:
    left, right = wall_pair(9.5, seed=1)
    rig = rig_for(left, 240.0)
    sky = np.repeat(np.linspace(170.0, 200.0, left.shape[0])[:, None], left.shape[1], axis=1)  # light, but nothing to match
    assert rig.finding(StereoPair(0, left, right)).ok
    assert np.isfinite(rig.depth(StereoPair(0, noisy(sky, 1), noisy(sky, 2))).metres).mean() < 0.002
    for k in range(1, 4):
        finding = rig.finding(StereoPair(k * NS // 10, noisy(sky, 10 + k), noisy(sky, 20 + k)))
        assert finding.verdict is UNKNOWN
        assert "of the image has a depth" in finding.reason or "too little texture" in finding.reason
    assert rig.finding(StereoPair(4 * NS // 10, noisy(left, 3), noisy(right, 4))).ok
    assert rig.finding(StereoPair(5 * NS // 10, noisy(left, 5), noisy(right, 6))).ok


@pytest.mark.parametrize("shown", [0.85, 0.7, 0.55])
def test_the_border_that_no_raw_image_shows_is_no_texture_without_a_depth(shown) -> None:
    """Rectified with a shorter focal length, images have a border that repeats what is at the raw ones' edge."""
    from test_zed_depth_calibration import info

    rig = StereoRig(ZedSettings())
    for side in ("left", "right"):
        rig.take_info(side, info(right=side == "right", fx=240.0 * shown, K=[240.0, 0, 240.0, 0, 240.0, 135.0, 0, 0, 1]))
    left, right = wall_pair(9.5, seed=1)
    good = [(noisy(left, 2 * k), noisy(right, 2 * k + 1)) for k in range(4)]
    findings = [rig.finding(StereoPair(k * NS // 2, *pair)) for k, pair in enumerate(good)]
    assert all(finding.ok for finding in findings), [finding.reason for finding in findings]
    strange = rig.finding(StereoPair(2 * NS, noisy(left, 9), noisy(gained(right, 4.0), 10)))
    assert not strange.ok
