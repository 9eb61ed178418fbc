"""How a picture is made smaller to fit a bit rate: size and frame rate, from the best to the last that is still of use."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Level:
    """What is encoded from ``min_bps`` on: a part of the camera's size, and at most so many frames per second."""

    scale: float
    fps: float
    min_bps: float

    def size(self, width: int, height: int) -> tuple[int, int]:
        """Return the encoded size in pixels, even as 4:2:0 needs it."""
        return max(2, round(width * self.scale / 2) * 2), max(2, round(height * self.scale / 2) * 2)


LADDER = (Level(1.0, 20.0, 650e3), Level(0.75, 20.0, 350e3), Level(0.5, 15.0, 180e3), Level(0.5, 10.0, 0.0))
"""At each border both neighbours look alike on the supplied building (`./alula bench video --ladder`)."""


def level_for(bit_rate_bps: float, current: Level | None = None, ladder: tuple[Level, ...] = LADDER) -> Level:
    """Return the best level for a bit rate; to go up from the current one takes a tenth more than to stay there."""
    for level in ladder:
        better = current is not None and level.min_bps > current.min_bps
        if bit_rate_bps >= level.min_bps * (1.1 if better else 1.0):
            return level
    return ladder[-1]
