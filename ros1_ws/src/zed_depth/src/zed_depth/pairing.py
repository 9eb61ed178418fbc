"""Left and right images to pairs of one moment."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING

from perception_core import NS

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Gray = NDArray[np.uint8]

WAITING = 8  # images of one side that may come before their partners: the two topics come on two connections


@dataclass(frozen=True)
class StereoPair:
    """Two grey images of one moment, as the cameras sent them."""

    stamp_ns: int
    left: Gray
    right: Gray


class Pairing:
    """Join left and right images whose stamps agree, also when one side comes some images later; not thread-safe."""

    def __init__(self, *, tolerance_s: float) -> None:
        self._tolerance_ns = int(tolerance_s * NS)
        self._waiting: dict[str, deque[tuple[int, Gray]]] = {side: deque(maxlen=WAITING) for side in ("left", "right")}

    def add(self, side: str, stamp_ns: int, image: Gray) -> StereoPair | None:
        """Take an image of the side ``left`` or ``right``; return the pair that it completes. Each image is used once, in order."""
        mine, others = self._waiting[side], self._waiting["right" if side == "left" else "left"]
        mine.append((stamp_ns, image))
        partner = min(others, key=lambda other: abs(other[0] - stamp_ns), default=None)
        if partner is None or abs(partner[0] - stamp_ns) > self._tolerance_ns:
            return None
        while others.popleft() is not partner:
            pass
        mine.clear()
        left, right = ((stamp_ns, image), partner) if side == "left" else (partner, (stamp_ns, image))
        return StereoPair(stamp_ns=left[0], left=left[1], right=right[1])

    def apart_s(self) -> float:
        """Return by how much the stamps of images that wait for each other differ at least; 0 while one side has none waiting."""
        left, right = ([stamp_ns for stamp_ns, _ in waiting] for waiting in self._waiting.values())
        return min((abs(one - other) for one in left for other in right), default=0) / NS
