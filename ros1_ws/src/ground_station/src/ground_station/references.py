"""What the camera saw, to compare the shown pictures with: it comes over another connection than the video."""

from __future__ import annotations

import threading
from collections import OrderedDict

from ground_station.quality import Rgb

KEPT = 120  # 6 s at 20 Hz: longer than a frame is waited for
WAIT_S = 5.0  # wall clock: a machine that is so busy shows pictures late, not others


class References:
    """The camera's last pictures by their stamps, noted in order; may be called from any thread."""

    def __init__(self) -> None:
        self._images: OrderedDict[int, Rgb] = OrderedDict()
        self._changed = threading.Condition()
        self._newest_ns = -1
        self._silent = False

    def __bool__(self) -> bool:
        """Return whether any has come."""
        return self._newest_ns >= 0

    def note(self, stamp_ns: int, image: Rgb) -> None:
        """Store what the camera saw at a moment, (H, W, 3) uint8 RGB."""
        with self._changed:
            self._images[stamp_ns] = image
            self._newest_ns = max(self._newest_ns, stamp_ns)
            self._silent = False
            while len(self._images) > KEPT:
                self._images.popitem(last=False)
            self._changed.notify_all()

    def find(self, stamp_ns: int) -> Rgb | None:
        """Return the picture of a moment; None: it never came.

        One that is on its way is waited for, which holds a simulator's time; a camera that stays silent is waited for once.
        """
        with self._changed:
            if not self._silent:
                self._silent = not self._changed.wait_for(lambda: self._newest_ns >= stamp_ns, WAIT_S)
            return self._images.get(stamp_ns)
