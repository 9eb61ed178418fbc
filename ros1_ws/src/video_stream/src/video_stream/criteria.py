"""By how much the telepilot's picture misses the criteria, and for how long that is tolerated. Pure.

The skill ``stream`` has invariants over the two margins: at least 0 means held. A margin is the best one of the last seconds that
are forgiven, and never below 0 while adaptation has something left to give: then it is not yet known that the criterion can't be met.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

from video_stream.wire import NS

MODEL_S = 1.0
"""The invariants of the model forgive this long by themselves (``for 1 s`` in video.skill)."""


@dataclass(frozen=True, kw_only=True)
class Criteria:
    """Frames per second, quality (SSIM, 0 to 1), and how many seconds either may be missed."""

    min_fps: float = 0.0
    min_quality: float = 0.0
    patience_s: float = MODEL_S

    def problem(self) -> str:
        """Return what is wrong with the criteria; empty where nothing is."""
        if not 0.0 < self.min_fps <= 60.0:
            return f"the least frame rate is {self.min_fps:g}; it must be above 0 and at most 60 frames per second"
        if not 0.0 <= self.min_quality < 1.0:
            return f"the least quality is {self.min_quality:g}; it must be at least 0 and below 1"
        if not MODEL_S <= self.patience_s <= 60.0:
            return f"the patience is {self.patience_s:g} s; it must be between {MODEL_S:g} and 60 s"
        return ""


@dataclass(frozen=True)
class Margins:
    """The measured values less the required ones; not negative: held, or not known to be beyond reach."""

    fps: float
    quality: float


class Watch:
    """Remembers the last values. Call ``look`` several times a second of mission clock."""

    def __init__(self, criteria: Criteria, now_ns: int) -> None:
        self.criteria = criteria
        self._values: deque[tuple[int, Margins]] = deque()
        # Before its first picture a stream is as good as it was asked to be, as long as it may be missed.
        self._values.append((now_ns, Margins(0.0, 0.0)))

    def look(self, *, fps: float, quality: float, exhausted: bool, now_ns: int) -> Margins:
        """Update with the ground station's values; return the margins."""
        forgiven_ns = int((self.criteria.patience_s - MODEL_S) * NS)
        present = Margins(fps - self.criteria.min_fps, quality - self.criteria.min_quality)
        self._values.append((now_ns, present if exhausted else Margins(max(present.fps, 0.0), max(present.quality, 0.0))))
        while self._values[0][0] < now_ns - forgiven_ns:
            self._values.popleft()
        return Margins(max(m.fps for _, m in self._values), max(m.quality for _, m in self._values))
