"""Left and right images to pairs of one moment."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from perception_core import NS

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Gray = NDArray[np.uint8]


@dataclass(frozen=True)
class StereoPair:
    """Two grey images of one moment, as the cameras sent them."""

    stamp_ns: int
    left: Gray
    right: Gray


class Pairing:
    """Join the newest left with the newest right image when their stamps agree; not thread-safe."""

    def __init__(self, *, tolerance_s: float) -> None:
        self._tolerance_ns = int(tolerance_s * NS)
        self._newest: dict[str, tuple[int, Gray]] = {}

    def add(self, side: str, stamp_ns: int, image: Gray) -> StereoPair | None:
        """Take an image of the side ``left`` or ``right``; return the pair that it completes. Each image is used once."""
        self._newest[side] = (stamp_ns, image)
        if len(self._newest) < 2:
            return None
        (left_ns, left), (right_ns, right) = self._newest["left"], self._newest["right"]
        if abs(left_ns - right_ns) > self._tolerance_ns:
            return None
        self._newest.clear()
        return StereoPair(stamp_ns=left_ns, left=left, right=right)

    def apart_s(self) -> float:
        """Return by how much the stamps of two images that wait for each other differ; 0 when fewer than two wait."""
        if len(self._newest) < 2:
            return 0.0
        return abs(self._newest["left"][0] - self._newest["right"][0]) / NS
