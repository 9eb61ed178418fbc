"""The last value of one data, and who follows it: what the feeds of all middlewares are made on."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from skill_model.model import Data
from skill_runtime.callbacks import Callbacks, Forget
from skill_runtime.staleness import is_stale
from skill_runtime.views import Sample


class SampleFeed:
    """Keeps the last sample and tells of each.

    Args:
        data: what is followed.
        now_ns: the mission clock.
    """

    def __init__(self, data: Data, now_ns: Callable[[], int]) -> None:
        self.data = data
        self.now_ns = now_ns
        self._lock = threading.Lock()
        self._callbacks: Callbacks[Callable[[Sample], None]] = Callbacks()
        self._sample: Sample | None = None

    @property
    def sample(self) -> Sample | None:
        """The last value; None before the first."""
        return self._sample

    @property
    def stale(self) -> bool:
        """Tell whether there is no value, or it is older than the model's period allows."""
        sample = self._sample
        return sample is None or (sample.stamp_ns is not None and is_stale(self.now_ns() - sample.stamp_ns, self.data.period_s))

    def on_sample(self, callback: Callable[[Sample], None]) -> Forget:
        """Have ``callback(sample)`` called for each value from now on; the return value ends that."""
        return self._callbacks.add(callback)

    def keep(self, sample: Sample) -> None:
        """Take a value and tell of it; one without a stamp is to be dated."""
        with self._lock:
            self._sample = sample
        if sample.stamp_ns is None:
            self.ask_stamp()
        for callback in self._callbacks:
            callback(sample)

    def ask_stamp(self) -> None:
        """Have ``date`` called, now or later, with the answer of the managers about the value that was there before this client."""

    def date(self, answer: Any) -> None:
        """Take the stamp from a skillset_interfaces/GetData response, unless another value has come meanwhile."""
        with self._lock:
            if answer.received and self._sample is not None and self._sample.stamp_ns is None:
                self._sample = Sample(self._sample.value, answer.stamp_ns)
