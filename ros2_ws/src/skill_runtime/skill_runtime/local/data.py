"""The data manager without middleware: last value, stamp, staleness."""

from __future__ import annotations

from dataclasses import dataclass

from skill_model.model import Data, Skillset
from skill_runtime.local.clock import VirtualClock
from skill_runtime.staleness import is_stale


@dataclass(frozen=True)
class DataReading:
    """A data at one moment, as the service ``get_data`` answers: ``stamp_ns`` and ``value`` only when something was received."""

    known: bool
    received: bool = False
    stale: bool = False
    stamp_ns: int = 0
    value: object = None


class LocalData:
    """The last values by name."""

    def __init__(self, clock: VirtualClock, skillset: Skillset) -> None:
        self._clock = clock
        self._skillset = skillset.name
        self._data = {data.name: data for data in skillset.data}
        self._received: dict[str, tuple[int, object]] = {}

    def check(self, name: str) -> None:
        """Raise KeyError when the skillset has no such data."""
        if name not in self._data:
            raise KeyError(f"skillset {self._skillset} has no data {name}; it has {', '.join(self._data) or 'none'}")

    def receive(self, name: str, value: object) -> None:
        """Keep a value; raise KeyError."""
        self.check(name)
        self._received[name] = (self._clock.now_ns, value)

    def read(self, name: str) -> DataReading:
        """Return what is known of a data now."""
        if name not in self._data:
            return DataReading(known=False)
        if name not in self._received:
            return DataReading(known=True)
        stamp_ns, value = self._received[name]
        return DataReading(known=True, received=True, stale=self._stale(self._data[name], stamp_ns), stamp_ns=stamp_ns, value=value)

    def _stale(self, data: Data, stamp_ns: int) -> bool:
        return is_stale(self._clock.now_ns - stamp_ns, data.period_s)
