"""The values of one data, as a client without middleware follows them."""

from __future__ import annotations

from collections.abc import Callable

from skill_language.model import Data
from skill_runtime.local.clock import VirtualClock
from skill_runtime.staleness import is_stale
from skill_runtime.views import Forget, Sample


class LocalFeed:
    """Keeps the last sample and tells of each."""

    def __init__(self, clock: VirtualClock, data: Data) -> None:
        self._clock = clock
        self._data = data
        self._sample: Sample | None = None
        self._callbacks: list[Callable[[Sample], None]] = []

    @property
    def sample(self) -> Sample | None:
        """The last value; None before the first."""
        return self._sample

    @property
    def stale(self) -> bool:
        """Tell whether there is no value, or it is older than the model's period allows."""
        sample = self._sample
        if sample is None or sample.stamp_ns is None:
            return True
        return is_stale(self._clock.now_ns - sample.stamp_ns, self._data.period_s)

    def on_sample(self, callback: Callable[[Sample], None]) -> Forget:
        """Have ``callback(sample)`` called for each value from now on; the return value ends that."""
        self._callbacks.append(callback)

        def forget() -> None:
            if callback in self._callbacks:
                self._callbacks.remove(callback)

        return forget

    def keep(self, sample: Sample) -> None:
        """Take a value."""
        self._sample = sample
        for callback in list(self._callbacks):
            callback(sample)
