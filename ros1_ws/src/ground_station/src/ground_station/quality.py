"""How good a picture is: against the one that was sent, and without it. Pure."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

Grey = NDArray[np.uint8]
Rgb = NDArray[np.uint8]
WINDOW = 11
SIGMA_PX = 1.5
C1, C2 = (0.01 * 255) ** 2, (0.03 * 255) ** 2
BLOCK = 8


def grey(image: Rgb) -> Grey:
    """Return the luma (ITU-R BT.601) of an RGB image, (H, W) uint8."""
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), dtype=np.uint8)


def ssim(first: Grey, second: Grey) -> float:
    """Return the mean structural similarity of two images of the same size (Wang, Bovik, Sheikh, Simoncelli 2004): 1 for equal ones.

    Gaussian window of 11 pixels with sigma 1.5, K1 = 0.01, K2 = 0.03, as in the paper; windows that leave the image don't count.
    """
    if first.shape != second.shape:
        raise ValueError(f"images of {first.shape} and {second.shape} can't be compared")
    x, y = first.astype(np.float32), second.astype(np.float32)
    mean_x, mean_y = _blur(x), _blur(y)
    variance_x = _blur(x * x) - mean_x * mean_x
    variance_y = _blur(y * y) - mean_y * mean_y
    covariance = _blur(x * y) - mean_x * mean_y
    similarity = (2 * mean_x * mean_y + C1) * (2 * covariance + C2)
    similarity /= (mean_x * mean_x + mean_y * mean_y + C1) * (variance_x + variance_y + C2)
    edge = WINDOW // 2
    return float(similarity[edge:-edge, edge:-edge].mean())


def _blur(image: NDArray[np.float32]) -> NDArray[np.float32]:
    return np.asarray(cv2.GaussianBlur(image, (WINDOW, WINDOW), SIGMA_PX), dtype=np.float32)


def no_reference(image: Grey) -> float:
    """Return how good a picture looks by itself, about 1 (bad) to 10 (Wang, Sheikh, Bovik 2002): blocking, activity, zero crossings."""
    x = image.astype(np.float32)
    features = [_block_features(x), _block_features(x.T)]
    blocking, activity, crossings = (np.mean(pair) for pair in zip(*features, strict=True))
    # The constants are the authors' fit to people's opinions.
    alpha, beta, g1, g2, g3 = -245.9, 261.9, -0.0240, 0.0160, 0.0064
    return float(alpha + beta * max(blocking, 1e-6) ** g1 * max(activity, 1e-6) ** g2 * max(crossings, 1e-6) ** g3)


def _block_features(x: NDArray[np.float32]) -> tuple[float, float, float]:
    """Return the differences across block borders, those within blocks, and how often the difference changes its sign, along rows."""
    difference = np.diff(x, axis=1)
    blocking = float(np.abs(difference[:, BLOCK - 1 :: BLOCK]).mean())
    activity = (BLOCK * float(np.abs(difference).mean()) - blocking) / (BLOCK - 1)
    signs = np.sign(difference)
    crossings = float((signs[:, :-1] * signs[:, 1:] < 0).mean())
    return blocking, activity, crossings
