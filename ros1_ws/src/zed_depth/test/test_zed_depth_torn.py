"""Parts of both images that are old: known by rows that come twice, and by a seam that stays in its row; no edge of a scene is one."""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np
import pytest

from perception_core import NS, FaultKind, Verdict
from perception_core.testing import wall_pair
from zed_depth import StereoPair
from zed_depth.torn_images import TornJudge

SEAM, OLD, PAIRS = 135, 3, 30


@cache
def wide() -> np.ndarray:
    """Return what a vehicle flies along, (1200, 1200)."""
    texture = np.random.default_rng(5).uniform(0, 255, (1200, 1200)).astype(np.float32)
    texture = cv2.GaussianBlur(texture, (0, 0), 2.0)
    return (texture - texture.mean()) * 4.0 + 120.0


def flight(*, down_px=1.0, across_px=4.0, first_row=300) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return pairs of a vehicle that moves along a wall, and sways up and down by some pixels."""
    pairs = []
    for k in range(PAIRS):
        row, column = first_row + round(3.0 * down_px * np.sin(1.1 * k)), 100 + round(across_px * k)
        seen = [wide()[row : row + 270, at : at + 480] for at in (column, column + 9)]
        noise = np.random.default_rng(k).normal(0.0, 1.5, (2, 270, 480))
        pairs.append(tuple(np.clip(image + grain, 0, 255).astype(np.uint8) for image, grain in zip(seen, noise, strict=True)))
    return pairs


def torn(pairs, k) -> tuple[np.ndarray, ...]:
    """Return a pair with the lower halves of an earlier one."""
    return tuple(np.vstack([now[:SEAM], old[SEAM:]]) for now, old in zip(pairs[k], pairs[k - OLD], strict=True))


def findings(pairs) -> list:
    judge = TornJudge()
    return [judge.finding(StereoPair(k * NS // 10, *map(np.ascontiguousarray, pair))) for k, pair in enumerate(pairs)]


def test_halves_that_are_old_are_known_at_once_and_as_long_as_they_are() -> None:
    pairs = flight()
    found = findings([*pairs[:10], *(torn(pairs, k) for k in range(10, 24)), *pairs[24:]])
    assert all(finding.ok for finding in found[:10])
    assert {(finding.verdict, finding.fault) for finding in found[10:24]} == {(Verdict.BROKEN, FaultKind.VIEW)}
    assert "is that of an earlier one, from row 136" in found[10].reason
    assert f"what they show breaks off at row {SEAM - 1}" in found[23].reason
    assert all(finding.ok for finding in found[24:])


def test_halves_that_were_old_from_the_start_are_known_by_a_seam_that_stays_in_its_row() -> None:
    pairs = flight()
    found = findings([torn(pairs, k) for k in range(OLD, PAIRS)])
    first = next(k for k, finding in enumerate(found) if not finding.ok)
    assert first <= 10
    assert not any(finding.ok for finding in found[first:])


@pytest.mark.parametrize("down_px", [0.0, 1.0])
def test_an_edge_of_the_scene_is_no_seam(down_px) -> None:
    """A wall's foot, level in the image: what is above has nothing of what is below. It moves with the image, or all stands in its row."""
    edge = wide().copy()
    try:
        wide()[435:] = np.roll(edge, 400, axis=1)[435:]
        assert all(finding.ok for finding in findings(flight(down_px=down_px)))
    finally:
        wide()[:] = edge


def test_what_stands_still_and_is_compressed_may_look_the_same_twice() -> None:
    still = [wall_pair(9.5, seed=k) for k in range(12)]
    first = still[0]
    again = [tuple(np.vstack([now[:SEAM], old[SEAM:]]) for now, old in zip(pair, first, strict=True)) for pair in still]
    assert all(finding.ok for finding in findings(again))
