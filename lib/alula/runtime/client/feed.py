"""The values of one data, as a client follows them."""

from __future__ import annotations

import threading
from collections.abc import Callable

from alula.model.model import Data
from alula.runtime.callbacks import Callbacks, Unsubscribe
from alula.runtime.middleware import Middleware, data_topic
from alula.runtime.staleness import is_stale
from alula.runtime.views import DataReading, Sample
from alula.runtime.waiting import Pending


class Feed:
    """Keep the last sample of ``data/<name>``, and report each.

    With ``every_s``, values that come within so many seconds after one are left out. A value is stamped when it arrives; the first one
    may have been latched for long, so its stamp is asked of the managers.
    """

    def __init__(self, middleware: Middleware, data: Data, read: Callable[[str], Pending[DataReading]], every_s: float = 0.0) -> None:
        self.data = data
        self._middleware = middleware
        self._read = read
        self._lock = threading.Lock()
        self._callbacks: Callbacks[Callable[[Sample], None]] = Callbacks()
        self._sample: Sample | None = None
        middleware.subscribe(data_topic(data, every_s=every_s), self._take)

    @property
    def sample(self) -> Sample | None:
        """The last value; None before the first."""
        return self._sample

    @property
    def stale(self) -> bool:
        """Return whether there is no value, or it is older than the model's period allows."""
        sample = self._sample
        if sample is None:
            return True
        return sample.stamp_ns is not None and is_stale(self._middleware.now_ns() - sample.stamp_ns, self.data.period_s)

    def on_sample(self, callback: Callable[[Sample], None]) -> Unsubscribe:
        """Call ``callback(sample)`` for each value from now on; the return value unsubscribes."""
        return self._callbacks.add(callback)

    def _take(self, sample: Sample) -> None:
        first = self._sample is None and sample.stamp_ns is None
        if not first and sample.stamp_ns is None:
            sample = Sample(sample.value, self._middleware.now_ns())
        with self._lock:
            self._sample = sample
        if first:
            self._read(self.data.name).add_done_callback(self._date)
        for callback in self._callbacks:
            callback(sample)

    def _date(self, answer: Pending[DataReading]) -> None:
        """Take the stamp of the first value, unless another value has come meanwhile."""
        with self._lock:
            if not answer.failure and answer.value.received and self._sample is not None and self._sample.stamp_ns is None:
                self._sample = Sample(self._sample.value, answer.value.stamp_ns)
