"""The comparison of encoders: the same bits for all, and what is said of each is measured on what comes out."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from ground_station.codecs import FFMPEG, OURS, RATE_BPS, WARM_UP_FRAMES, Row, compare, ours, plain, table

FRAMES = WARM_UP_FRAMES + 50


def pictures() -> list[np.ndarray]:
    """A pan over structures, with the noise of a sensor: what would fit into much fewer bits tells nothing of a bit rate."""
    rng = np.random.default_rng(5)
    scenery = cv2.resize(rng.integers(0, 255, (60, 400, 3), dtype=np.uint8), (1280, 180), interpolation=cv2.INTER_CUBIC)
    noisy = [scenery[:, 4 * n : 4 * n + 320] + rng.normal(0.0, 8.0, (180, 320, 3)) for n in range(FRAMES)]
    return [np.clip(image, 0, 255).astype(np.uint8) for image in noisy]


@pytest.fixture(scope="module")
def rows() -> dict[str, Row]:
    candidates = {OURS: ours("veryfast"), FFMPEG: plain("veryfast"), "quick": ours("ultrafast")}
    return {row.name: row for row in compare(pictures(), candidates)}


def test_all_have_the_same_bits(rows):
    for row in rows.values():
        assert row.kbit_s == pytest.approx(RATE_BPS / 1e3, rel=0.1), row


def test_ours_looks_no_worse_than_ffmpeg_s_and_better_than_a_preset_that_saves_time(rows):
    assert rows[OURS].ssim >= rows[FFMPEG].ssim
    assert rows[OURS].ssim > rows["quick"].ssim
    assert rows[OURS].ssim < 1.0


def test_the_table_has_a_line_each(rows):
    lines = table(list(rows.values())).splitlines()
    assert len(lines) == 2 + len(rows)
    assert all(line.count("|") == lines[0].count("|") for line in lines)
    assert f"| {OURS} | {rows[OURS].ssim:.4f} |" in lines[2]
