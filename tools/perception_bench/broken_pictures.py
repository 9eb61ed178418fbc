"""A hundred and twenty ways in which the pictures of a stereo camera go wrong, each with the cause that a finding should name."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import cv2
import numpy as np
from numpy.typing import NDArray
from sensor_msgs.msg import CameraInfo, Image

from perception_core import NS
from perception_core.images import GrayConverter
from zed_depth import StereoPair

Gray = NDArray[np.uint8]
Floats = NDArray[np.float64]
Rng = np.random.Generator
FOCAL_SHARE = 0.5  # of the width: about that of the cameras of all recordings here


@dataclass(frozen=True)
class PairInTime:
    """A pair of a good recording that is to be broken: all pairs, the number of this one and of the first broken one, and a generator."""

    pairs: Sequence[StereoPair]
    number: int
    first: int
    rng: Rng

    @property
    def pair(self) -> StereoPair:
        """The good pair."""
        return self.pairs[self.number]

    def earlier(self, count: int) -> StereoPair:
        """Return a good pair so many before this one."""
        return self.pairs[max(0, self.number - count)]

    def noise(self, sigma: float = 1.0) -> Floats:
        """Return noise of one image, grey levels."""
        return self.rng.normal(0.0, sigma, self.pair.left.shape)


Break = Callable[[PairInTime], StereoPair]
Infos = dict[str, CameraInfo]


@dataclass(frozen=True)
class PictureKind:
    """One way to be broken: what became of a pair, or of both camera_infos; any of the ``causes`` in a finding's words is the right one."""

    name: str
    parameter: str
    causes: tuple[str, ...]
    pair: Break = lambda moment: moment.pair
    infos: Callable[[Infos], Infos] = lambda infos: infos
    harmless: bool = False  # depths are right: a finding is no duty


def _gray(values: NDArray[np.floating] | NDArray[np.integer]) -> Gray:
    return np.clip(np.round(values), 0, 255).astype(np.uint8)


Change = Callable[[Gray, PairInTime], Gray]


def _right(change: Change) -> Break:
    return lambda moment: replace(moment.pair, right=change(moment.pair.right, moment))


def _left(change: Change) -> Break:
    return lambda moment: replace(moment.pair, left=change(moment.pair.left, moment))


def _both(change: Change) -> Break:
    return lambda moment: replace(moment.pair, left=change(moment.pair.left, moment), right=change(moment.pair.right, moment))


# --- geometry ------------------------------------------------------------------------------------------------------------------


def _warped(image: Gray, matrix: Floats) -> Gray:
    size = image.shape[::-1]
    return np.asarray(cv2.warpPerspective(image, matrix, size, borderMode=cv2.BORDER_REPLICATE), dtype=np.uint8)


def _turned(axis: tuple[float, float, float], degrees: float, image: Gray, _moment: PairInTime) -> Gray:
    """Return what a camera sees that turned about an axis of its own: right, down, ahead."""
    height, width = image.shape
    focal = FOCAL_SHARE * width
    K = np.array([[focal, 0.0, width / 2], [0.0, focal, height / 2], [0.0, 0.0, 1.0]])  # noqa: N806 -- the message's name
    turn = cv2.Rodrigues(np.radians(degrees) * np.array(axis))[0]
    return _warped(image, K @ turn @ np.linalg.inv(K))


ROLLED, YAWED, PITCHED = (partial(_turned, axis) for axis in ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0)))


def _moved(columns: float, rows: float, image: Gray, _moment: PairInTime) -> Gray:
    return _warped(image, np.array([[1.0, 0.0, columns], [0.0, 1.0, rows], [0.0, 0.0, 1.0]]))


def _zoomed(factor: float, image: Gray, _moment: PairInTime) -> Gray:
    height, width = image.shape
    return _warped(image, np.array([[factor, 0.0, (1 - factor) * width / 2], [0.0, factor, (1 - factor) * height / 2], [0.0, 0.0, 1.0]]))


def _barrel(strength: float, image: Gray, _moment: PairInTime) -> Gray:
    height, width = image.shape
    rows, columns = np.indices(image.shape, dtype=np.float32)
    u, v = (columns - width / 2) / width, (rows - height / 2) / width
    factor = 1.0 + strength * (u * u + v * v)
    return np.asarray(cv2.remap(image, u * factor * width + width / 2, v * factor * width + height / 2, cv2.INTER_LINEAR), dtype=np.uint8)


def _mirrored(image: Gray, _moment: PairInTime) -> Gray:
    return np.ascontiguousarray(image[:, ::-1])


def _upside_down(image: Gray, _moment: PairInTime) -> Gray:
    return np.ascontiguousarray(image[::-1, ::-1])


def _flipped(image: Gray, _moment: PairInTime) -> Gray:
    return np.ascontiguousarray(image[::-1])


def _quarter(image: Gray, _moment: PairInTime) -> Gray:
    """Return an image turned by a quarter and scaled to the same size, as a wrong rotation in the driver makes it."""
    return np.asarray(cv2.resize(np.rot90(image), image.shape[::-1], interpolation=cv2.INTER_AREA), dtype=np.uint8)


def _swapped(moment: PairInTime) -> StereoPair:
    return replace(moment.pair, left=moment.pair.right, right=moment.pair.left)


def _doubled(sigma: float, moment: PairInTime) -> StereoPair:
    left = moment.pair.left
    return replace(moment.pair, right=_gray(left + moment.noise(sigma)) if sigma else left.copy())


# --- time ----------------------------------------------------------------------------------------------------------------------


def _right_late(count: int, moment: PairInTime) -> StereoPair:
    return replace(moment.pair, right=moment.earlier(count).right)


def _left_late(count: int, moment: PairInTime) -> StereoPair:
    return replace(moment.pair, left=moment.earlier(count).left)


def _sometimes_late(moment: PairInTime) -> StereoPair:
    return _right_late(3, moment) if moment.number % 2 else moment.pair


def _old(count: int, moment: PairInTime) -> StereoPair:
    return replace(moment.earlier(count), stamp_ns=moment.pair.stamp_ns)


def _frozen(sides: str, sigma: float, moment: PairInTime) -> StereoPair:
    last = moment.pairs[moment.first - 1]
    images = {side: getattr(last if side in sides else moment.pair, side) for side in ("left", "right")}
    if sigma:
        images = {side: _gray(image + moment.noise(sigma)) if side in sides else image for side, image in images.items()}
    return replace(moment.pair, **images)


def _flickering(moment: PairInTime) -> StereoPair:
    pair = _frozen("left right", 0.0, moment)
    left = pair.left.copy()
    left[0, 0] = moment.rng.integers(0, 256)
    return replace(pair, left=left)


def _in_turns(moment: PairInTime) -> StereoPair:
    """Return the last two good pairs in turns, as of a ring of buffers that is filled no more."""
    return replace(moment.pairs[moment.first - 1 - moment.number % 2], stamp_ns=moment.pair.stamp_ns)


def _stamped(shift_s: float, moment: PairInTime) -> StereoPair:
    return replace(moment.pair, stamp_ns=moment.pair.stamp_ns + round(shift_s * NS))


def _stamp_stands(moment: PairInTime) -> StereoPair:
    return replace(moment.pair, stamp_ns=moment.pairs[moment.first - 1].stamp_ns)


# --- light ---------------------------------------------------------------------------------------------------------------------


def _exposed(gain: float, image: Gray, moment: PairInTime, *, offset: float = 0.0, sigma: float = 1.5) -> Gray:
    return _gray(gain * image.astype(np.float64) + offset + moment.noise(sigma))


def _gamma(exponent: float, image: Gray, _moment: PairInTime) -> Gray:
    return _gray(255.0 * (image / 255.0) ** exponent)


def _negative(image: Gray, _moment: PairInTime) -> Gray:
    return np.asarray(255 - image, dtype=np.uint8)


def _flickering_light(image: Gray, moment: PairInTime) -> Gray:
    return _exposed(float(moment.rng.uniform(0.3, 2.0)), image, moment)


def _flare(share: float, image: Gray, _moment: PairInTime) -> Gray:
    """Return an image with the sun in it: white within a share of the width around a place above the middle, fading out from there."""
    height, width = image.shape
    rows, columns = np.indices(image.shape)
    away = np.hypot(columns - 0.5 * width, rows - 0.3 * height) / (share * width)
    return _gray(image + 255.0 / (1.0 + away**4))


def _bands(image: Gray, moment: PairInTime) -> Gray:
    """Return an image under a light that flickers while the rows are read out."""
    rows = np.arange(image.shape[0])[:, None]
    return _gray(image * (0.6 + 0.4 * np.sin(2 * np.pi * rows / 40.0 + moment.number)))


def _fog(share: float, image: Gray, _moment: PairInTime) -> Gray:
    return _gray((1.0 - share) * image + share * 220.0)


# --- sharpness and noise ---------------------------------------------------------------------------------------------------------


def _blurred(sigma: float, image: Gray, moment: PairInTime) -> Gray:
    return _gray(cv2.GaussianBlur(image, (0, 0), sigma) + moment.noise())


def _dragged(length: int, image: Gray, moment: PairInTime) -> Gray:
    return _gray(cv2.blur(image, (length, 1)) + moment.noise())


def _noisy(sigma: float, image: Gray, moment: PairInTime) -> Gray:
    return _gray(image + moment.noise(sigma))


def _salted(share: float, image: Gray, moment: PairInTime) -> Gray:
    hit = moment.rng.random(image.shape) < share
    return np.where(hit, moment.rng.choice(np.array([0, 255], np.uint8), image.shape), image)


def _striped(sigma: float, image: Gray, _moment: PairInTime) -> Gray:
    """Return an image whose columns have a noise of their own that stays."""
    return _gray(image + np.random.default_rng(5).normal(0.0, sigma, image.shape[1])[None, :])


# --- transfer --------------------------------------------------------------------------------------------------------------------


def _jpeg(quality: int, image: Gray, _moment: PairInTime) -> Gray:
    coded = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])[1]
    return np.asarray(cv2.imdecode(coded, cv2.IMREAD_GRAYSCALE), dtype=np.uint8)


def _displaced(count: int, image: Gray, _moment: PairInTime) -> Gray:
    return np.roll(image.reshape(-1), count).reshape(image.shape)


def _part_old(rows: slice, sides: str, count: int, moment: PairInTime) -> StereoPair:
    images = {}
    for side in sides.split():
        image, old = getattr(moment.pair, side).copy(), getattr(moment.earlier(count), side)
        height = len(image)
        part = slice(*(None if share is None else round(share * height) for share in (rows.start, rows.stop)))
        image[part] = old[part]
        images[side] = image
    return replace(moment.pair, **images)


def _interlaced(sides: str, moment: PairInTime) -> StereoPair:
    """Return a pair whose odd rows are of the pair before."""
    images = {}
    for side in sides.split():
        image = getattr(moment.pair, side).copy()
        image[1::2] = getattr(moment.earlier(1), side)[1::2]
        images[side] = image
    return replace(moment.pair, **images)


def _rows_missing(share: float, image: Gray, _moment: PairInTime) -> Gray:
    missing = image.copy()
    missing[round((1.0 - share) * len(image)) :] = 0
    return missing


def _rows_torn(pixels: int, image: Gray, moment: PairInTime) -> Gray:
    """Return an image whose rows are moved to the side at random."""
    shifts = moment.rng.integers(-pixels, pixels + 1, len(image))
    columns = (np.arange(image.shape[1])[None, :] - shifts[:, None]) % image.shape[1]
    return np.take_along_axis(image, columns, axis=1)


def _skewed(image: Gray, _moment: PairInTime) -> Gray:
    """Return an image whose rows are a byte longer than is told."""
    columns = (np.arange(image.shape[1])[None, :] + np.arange(len(image))[:, None]) % image.shape[1]
    return np.take_along_axis(image, columns, axis=1)


def _dead_columns(every: int, image: Gray, _moment: PairInTime) -> Gray:
    dead = image.copy()
    dead[:, ::every] = 0
    return dead


def _blocks_lost(share: float, image: Gray, moment: PairInTime) -> Gray:
    size = 16
    rows, columns = (-(-length // size) for length in image.shape)
    lost = np.kron(moment.rng.random((rows, columns)) < share, np.ones((size, size), bool))[: image.shape[0], : image.shape[1]]
    return np.where(lost, np.uint8(128), image)


def _as_other_encoding(image: Gray, _moment: PairInTime) -> Gray:
    """Return what becomes of UYVY that is told to be YUYV: the colours for the light."""
    colours = _gray(128 + 0.15 * (cv2.GaussianBlur(image, (0, 0), 3.0).astype(np.float64) - 128))
    data = np.stack([colours, image], axis=2).tobytes()
    height, width = image.shape
    return GrayConverter().gray(Image(height=height, width=width, encoding="yuv422_yuy2", step=2 * width, data=data))


def _as_mono(image: Gray, _moment: PairInTime) -> Gray:
    """Return a Bayer pattern of a coloured scene that is taken for grey."""
    bayer = image.astype(np.float64)
    bayer[::2, ::2] *= 0.6
    bayer[1::2, 1::2] *= 0.5
    return _gray(bayer)


def _bytes_swapped(image: Gray, moment: PairInTime) -> Gray:
    """Return the high bytes of an image of 16 bits in the other order: the noise of its low bits."""
    return ((image.astype(np.uint16) * 257 + moment.rng.integers(0, 256, image.shape, dtype=np.uint16)) & 255).astype(np.uint8)


def _bit_stuck(bit: int, image: Gray, _moment: PairInTime) -> Gray:
    return np.asarray(image | np.uint8(1 << bit), dtype=np.uint8)


def _overflowing(image: Gray, _moment: PairInTime) -> Gray:
    """Return an image twice as bright that begins at black again beyond white."""
    return (image.astype(np.uint16) * 2 % 256).astype(np.uint8)


def _coarse(factor: int, image: Gray, _moment: PairInTime) -> Gray:
    height, width = image.shape
    small = cv2.resize(image, (width // factor, height // factor), interpolation=cv2.INTER_AREA)
    return np.asarray(cv2.resize(small, (width, height), interpolation=cv2.INTER_NEAREST), dtype=np.uint8)


# --- lenses ----------------------------------------------------------------------------------------------------------------------


def _covered(begin: float, end: float, image: Gray, moment: PairInTime, *, down: bool = False) -> Gray:
    """Return the image of a lens that a cap or a finger covers between two shares of its width, or height; its edge is blurred."""
    places = np.linspace(0.0, 1.0, image.shape[0 if down else 1])
    free = 1.0 - 1.0 / (1.0 + np.exp((begin - places) / 0.02)) / (1.0 + np.exp((places - end) / 0.02))
    free = free[:, None] if down else free[None, :]
    return _gray(image * free + 30.0 * (1.0 - free) + moment.noise())


def _drops(count: int, seed: int, image: Gray, moment: PairInTime) -> Gray:
    """Return the image of a lens with drops of water: within each the scene is blurred and moved."""
    rng = np.random.default_rng(seed)
    height, width = image.shape
    rows, columns = np.indices(image.shape)
    blurred = np.roll(cv2.GaussianBlur(image, (0, 0), 6.0), 12, axis=0)
    wet = np.zeros(image.shape, dtype=bool)
    for _ in range(count):
        row, column, radius = rng.uniform(0.2, 0.8) * height, rng.uniform(0.2, 0.8) * width, rng.uniform(0.04, 0.09) * width
        wet |= np.hypot(rows - row, columns - column) < radius
    return _gray(np.where(wet, blurred, image) + moment.noise())


def _propeller(image: Gray, moment: PairInTime) -> Gray:
    """Return an image with a blade across it, at another angle each time."""
    height, width = image.shape
    rows, columns = np.indices(image.shape)
    angle = moment.rng.uniform(0.0, np.pi)
    across = np.abs((columns - 0.1 * width) * np.sin(angle) - (rows - 0.1 * height) * np.cos(angle))
    return _gray(np.where(across < 0.03 * width, 25.0, image))


def _scratched(image: Gray, _moment: PairInTime) -> Gray:
    """Return an image through a cracked glass: what is right of a line is moved by some pixels."""
    rows, columns = np.indices(image.shape)
    crack = columns > 0.4 * image.shape[1] + 0.3 * rows
    return np.where(crack, np.roll(image, (3, 4), axis=(0, 1)), image)


def _half_covered_both(moment: PairInTime) -> StereoPair:
    """Return a pair of which each lens is covered at its outer side."""
    return replace(moment.pair, left=_covered(-1.0, 0.3, moment.pair.left, moment), right=_covered(0.7, 2.0, moment.pair.right, moment))


# --- camera_info -----------------------------------------------------------------------------------------------------------------


def _info(base: CameraInfo, *, width: float = 1.0, matrices: float = 1.0, baseline: float = 1.0, columns: float = 0.0) -> CameraInfo:
    K, P = list(base.K), list(base.P)  # noqa: N806 -- the message's names
    for number in (0, 2, 4, 5):
        K[number] *= matrices
    for number in (0, 2, 3, 5, 6):
        P[number] *= matrices
    P[3] *= baseline
    K[2] += columns
    P[2] += columns
    size = {"width": round(base.width * width), "height": round(base.height * width)}
    return CameraInfo(distortion_model=base.distortion_model, D=list(base.D), K=K, R=list(base.R), P=P, **size)


def _of_both(infos: Infos, **changes: float) -> Infos:
    return {side: _info(info, **changes) for side, info in infos.items()}


def _of_right(infos: Infos, **changes: float) -> Infos:
    return infos | {"right": _info(infos["right"], **changes)}


def _infos_swapped(infos: Infos) -> Infos:
    return {"left": infos["right"], "right": infos["left"]}


def _not_finite(infos: Infos) -> Infos:
    broken = _info(infos["left"])
    broken.K = [float("nan"), *broken.K[1:]]
    return infos | {"left": broken}


CALIBRATION = ("a camera has moved", "turned", "calibrate")
SWAPPED = ("swapped", "mirrored or upside down")
LATE = ("older than the other", "synchroni", "same scene")
FROZEN, STAMP = ("frozen", "repeats"), ("stamp", "old when it arrives")
LIGHT, BLUR, NOISE = ("expos", "dark", "bright", "white", "blank", "light"), ("blur",), ("noise", "exposure", "compress", "texture")
TRANSFER = ("transfer", "compress", "bytes are lost", "lost", "missing", "encoding", "row", "old", "columns dead")
LENS, INFO = ("covered", "lens", "blur", "dirt"), ("camera_info", "focal length", "baseline", "calibrate")
HALF = slice(0.5, None)


def _family(
    name: str, causes: tuple[str, ...], unit: str, make: Callable[[float], Break], values: Sequence[float], harmless: Sequence[float] = ()
) -> list[PictureKind]:
    return [PictureKind(name, f"{value:g}{unit}", causes, make(value), harmless=value in harmless) for value in values]


def _of(part: Callable[[Change], Break], change: Callable[..., Gray]) -> Callable[[float], Break]:
    """Return what makes a break of a value, of one image or of both."""
    return lambda value: part(partial(change, value))


def _of_int(part: Callable[[Change], Break], change: Callable[..., Gray]) -> Callable[[float], Break]:
    return lambda value: part(partial(change, int(value)))


PICTURES: tuple[PictureKind, ...] = (
    *_family("right image lower", CALIBRATION, " px", lambda value: _right(partial(_moved, 0.0, value)), (1, 2, 3, 20), harmless=(1,)),
    *_family("right camera rolled", CALIBRATION, " degrees", _of(_right, ROLLED), (0.5, 1, 5)),
    *_family("right camera turned inwards", CALIBRATION, " degrees", lambda value: _right(partial(YAWED, -value)), (0.3, 0.6, 1, 2)),
    *_family("right camera turned outwards", CALIBRATION, " degrees", _of(_right, YAWED), (0.3, 0.6, 2)),
    *_family("right camera pitched", CALIBRATION, " degrees", _of(_right, PITCHED), (0.3, 1.5)),
    *_family("right image zoomed", CALIBRATION, " times", _of(_right, _zoomed), (0.95, 1.02)),
    *_family("right sensor moved", CALIBRATION, " px", lambda value: _right(partial(_moved, value, 0.0)), (-4, 2)),
    PictureKind("right image distorted", "barrel 0.1", CALIBRATION, _right(partial(_barrel, 0.1))),
    PictureKind("both images distorted", "barrel 0.3", INFO, _both(partial(_barrel, 0.3))),
    PictureKind("both cameras rolled", "5 degrees", CALIBRATION, _both(partial(ROLLED, 5.0))),
    PictureKind("left camera turned inwards", "1 degree", CALIBRATION, _left(partial(YAWED, 1.0))),
    PictureKind("both mirrored", "", SWAPPED, _both(_mirrored)),
    PictureKind("both upside down", "", SWAPPED, _both(_upside_down)),
    PictureKind("both flipped", "rows", (*SWAPPED, "upside down"), _both(_flipped), harmless=True),
    PictureKind("both turned", "90 degrees", (*SWAPPED, "same scene", "rows"), _both(_quarter)),
    PictureKind("right mirrored", "", ("same scene",), _right(_mirrored)),
    PictureKind("swapped", "", SWAPPED, _swapped),
    PictureKind("doubled", "", ("same image",), partial(_doubled, 0.0)),
    PictureKind("doubled", "noise of 1.5", ("both cameras show the same",), partial(_doubled, 1.5)),
    *_family("right image late", LATE, " pairs", lambda value: partial(_right_late, int(value)), (1, 2, 5), harmless=(1,)),
    PictureKind("left image late", "2 pairs", LATE, partial(_left_late, 2)),
    PictureKind("right image late", "every second pair", LATE, _sometimes_late),
    PictureKind("both images late, stamped anew", "10 pairs", ("old",), partial(_old, 10)),
    PictureKind("both frozen", "", FROZEN, partial(_frozen, "left right", 0.0)),
    PictureKind("both frozen", "noise of 1.5", FROZEN, partial(_frozen, "left right", 1.5)),
    PictureKind("right frozen", "", FROZEN, partial(_frozen, "right", 0.0)),
    PictureKind("right frozen", "noise of 1.5", (*FROZEN, *LATE), partial(_frozen, "right", 1.5)),
    PictureKind("left frozen", "", FROZEN, partial(_frozen, "left", 0.0)),
    PictureKind("both frozen", "but for a pixel", FROZEN, _flickering),
    PictureKind("two pairs in turns", "", FROZEN, _in_turns),
    *_family("stamp shifted", STAMP, " s", lambda value: partial(_stamped, value), (-0.5, 0.3, 10)),
    PictureKind("stamp stands", "", STAMP, _stamp_stands),
    *_family("both darker", LIGHT, " times", _of(_both, _exposed), (0, 0.01, 0.05)),
    *_family("right darker", LIGHT, " times", _of(_right, _exposed), (0.05, 0.3), harmless=(0.3,)),
    *_family("both brighter", LIGHT, " times", _of(_both, _exposed), (4,)),
    *_family("right brighter", LIGHT, " times", _of(_right, _exposed), (2,)),
    PictureKind("both white", "", LIGHT, _both(partial(_exposed, 2.0, offset=220.0))),
    PictureKind("right white", "", LIGHT, _right(partial(_exposed, 2.0, offset=220.0))),
    PictureKind("left grey", "", LIGHT, _left(partial(_exposed, 0.0, offset=128.0))),
    *_family("right gamma", (*LIGHT, "convert"), "", _of(_right, _gamma), (0.45, 2.2)),
    PictureKind("right negative", "", (*LIGHT, "same scene", "convert"), _right(_negative)),
    PictureKind("right flickers", "0.3 to 2 times", LIGHT, _right(_flickering_light), harmless=True),
    *_family("flare in both", LIGHT, " of the width", _of(_both, _flare), (0.25,)),
    *_family("flare in the right", (*LIGHT, "covered"), " of the width", _of(_right, _flare), (0.1, 0.25)),
    PictureKind("bands of light in both", "", LIGHT, _both(_bands), harmless=True),
    *_family("fog before both", (*LIGHT, "texture"), "", _of(_both, _fog), (0.5, 0.85), harmless=(0.5,)),
    *_family("both blurred", BLUR, " px", _of(_both, _blurred), (2, 3, 8), harmless=(2,)),
    *_family("right blurred", BLUR, " px", _of(_right, _blurred), (3, 5)),
    *_family("dragged", BLUR, " px", _of_int(_both, _dragged), (9, 21), harmless=(9,)),
    *_family("both noisy", NOISE, " grey levels", _of(_both, _noisy), (10, 20, 40), harmless=(10,)),
    *_family("right noisy", NOISE, " grey levels", _of(_right, _noisy), (40,)),
    *_family("salt and pepper", NOISE, " of the pixels", _of(_both, _salted), (0.01, 0.1), harmless=(0.01,)),
    *_family("columns with noise", NOISE, " grey levels", _of(_both, _striped), (25,)),
    *_family("compressed", TRANSFER, " quality", _of_int(_both, _jpeg), (3, 8)),
    *_family("both displaced", TRANSFER, " bytes", _of_int(_both, _displaced), (100,)),
    PictureKind("right displaced", "100 bytes", (*TRANSFER, "same scene", *CALIBRATION), _right(partial(_displaced, 100))),
    PictureKind("lower half old", "both, 3 pairs", TRANSFER, partial(_part_old, HALF, "left right", 3)),
    PictureKind("lower half old", "right, 3 pairs", TRANSFER, partial(_part_old, HALF, "right", 3)),
    PictureKind("upper half old", "right, 5 pairs", TRANSFER, partial(_part_old, slice(None, 0.5), "right", 5)),
    PictureKind("every second row old", "right", TRANSFER, partial(_interlaced, "right"), harmless=True),
    PictureKind("lower third missing", "right", TRANSFER, _right(partial(_rows_missing, 1 / 3))),
    *_family("rows torn", TRANSFER, " px", _of_int(_right, _rows_torn), (4,)),
    PictureKind("rows a byte longer", "both", TRANSFER, _both(_skewed)),
    PictureKind("every 8th column dead", "both", TRANSFER, _both(partial(_dead_columns, 8))),
    PictureKind("every 8th column dead", "right", TRANSFER, _right(partial(_dead_columns, 8))),
    *_family("blocks lost", TRANSFER, " of all", _of(_both, _blocks_lost), (0.05, 0.3)),
    PictureKind("another encoding", "both", TRANSFER, _both(_as_other_encoding)),
    PictureKind("Bayer taken for grey", "both", TRANSFER, _both(_as_mono), harmless=True),
    PictureKind("bytes in the other order", "both", TRANSFER, _both(_bytes_swapped)),
    PictureKind("highest bit stuck", "both", TRANSFER, _both(partial(_bit_stuck, 7))),
    PictureKind("overflowing", "right", (*TRANSFER, *LIGHT), _right(_overflowing)),
    PictureKind("coarse", "4 px", (*TRANSFER, *BLUR), _both(partial(_coarse, 4))),
    PictureKind("lens covered", "a third of both", LENS, _both(partial(_covered, -1.0, 0.33))),
    PictureKind("lens covered", "a third of the right", LENS, _right(partial(_covered, -1.0, 0.33))),
    PictureKind("lens covered", "a finger in the right", LENS, _right(partial(_covered, 0.4, 0.55))),
    PictureKind("lens covered", "lower half of both", LENS, _both(partial(_covered, 0.5, 2.0, down=True))),
    PictureKind("lens covered", "the outer sides", LENS, _half_covered_both),
    PictureKind("drops", "in the right", LENS, _right(partial(_drops, 5, 1))),
    PictureKind("drops", "in both", LENS, lambda moment: _left(partial(_drops, 5, 2))(replace_pair(moment, _right(partial(_drops, 5, 1))))),
    PictureKind("a propeller in view", "both", LENS, _both(_propeller)),
    PictureKind("cracked glass", "right", LENS + CALIBRATION, _right(_scratched)),
    PictureKind("camera_info of half the size", "P", INFO, infos=partial(_of_both, matrices=0.5)),
    PictureKind("camera_info of other images", "twice as wide", INFO, infos=partial(_of_both, width=2.0, matrices=2.0)),
    PictureKind("camera_infos swapped", "", INFO, infos=_infos_swapped),
    PictureKind("camera_info not finite", "K", INFO, infos=_not_finite),
    PictureKind("baseline", "1.5 times", INFO, infos=partial(_of_right, baseline=1.5)),
    PictureKind("focal length", "1.3 times", INFO, infos=partial(_of_both, matrices=1.3)),
    PictureKind("principal point of the right", "10 px", INFO, infos=partial(_of_right, columns=10.0)),
)


def replace_pair(moment: PairInTime, change: Break) -> PairInTime:
    """Return the moment with its pair changed."""
    pairs = {moment.number: change(moment)}
    return replace(moment, pairs=[pairs.get(number, pair) for number, pair in enumerate(moment.pairs)])
