"""How each sensor fares: ok or broken in one of three ways, now or at a moment of the flight."""

from __future__ import annotations

import threading
from dataclasses import dataclass
from enum import Enum

from uav_simulator.errors import ConfigError

SENSORS = ("zed", "lidar", "imu")


class SensorMode(Enum):
    """What a sensor's driver publishes."""

    OK = "ok"
    DEAD = "dead"  # nothing
    BLACK = "black"  # measurements without content: images of zeros, no returns, zero rates and forces
    FROZEN = "frozen"  # the last measurement again and again, with new stamps


@dataclass(frozen=True)
class Fault:
    """A sensor's change of mode; ``after_lift_off_s`` None: at the start of the simulation."""

    sensor: str
    mode: SensorMode
    after_lift_off_s: float | None


@dataclass(frozen=True)
class FaultRecord:
    """A change that happened, at a moment of the simulated clock."""

    sensor: str
    mode: SensorMode
    t_s: float


def parse_faults(text: str) -> list[Fault]:
    """Read ``SENSOR[:MODE][@SECONDS],...``, for example ``zed@30,lidar:black@40``; raises ConfigError naming the wrong word."""
    faults = []
    for word in (w.strip() for w in text.split(",")):
        if not word:
            continue
        what, at, seconds = word.partition("@")
        sensor, _, mode = what.partition(":")
        _check_names(sensor, mode or "dead")
        try:
            after = float(seconds) if at else None
        except ValueError:
            raise ConfigError(f"fault {word!r}: {seconds!r} is no number of seconds") from None
        faults.append(Fault(sensor, SensorMode(mode or "dead"), after))
    return faults


def _check_names(sensor: str, mode: str) -> None:
    if sensor not in SENSORS:
        raise ConfigError(f"unknown sensor {sensor!r}; known are {', '.join(SENSORS)}")
    known = [m.value for m in SensorMode]
    if mode not in known:
        raise ConfigError(f"unknown sensor mode {mode!r}; known are {', '.join(known)}")


class SensorBoard:
    """The sensors' modes. Set from a service's thread, read from the simulation's."""

    def __init__(self, faults: list[Fault]) -> None:
        self._lock = threading.Lock()
        self._modes = dict.fromkeys(SENSORS, SensorMode.OK)
        self._pending = list(faults)
        self._records: list[FaultRecord] = []

    def mode(self, sensor: str) -> SensorMode:
        """Return a sensor's mode."""
        with self._lock:
            return self._modes[sensor]

    @property
    def modes(self) -> dict[str, str]:
        """Return all modes by name."""
        with self._lock:
            return {sensor: mode.value for sensor, mode in self._modes.items()}

    @property
    def records(self) -> list[FaultRecord]:
        """Return what happened so far, in order."""
        with self._lock:
            return list(self._records)

    def set(self, sensor: str, mode: str, t_s: float) -> None:
        """Break or mend a sensor at a moment of the simulated clock; raises ConfigError for a wrong name."""
        _check_names(sensor, mode)
        with self._lock:
            self._modes[sensor] = SensorMode(mode)
            self._records.append(FaultRecord(sensor, SensorMode(mode), t_s))

    def apply_due(self, now_s: float, lift_off_s: float | None) -> bool:
        """Let the scheduled faults happen that are due; return whether one did."""
        due = [f for f in self._pending if _is_due(f, now_s, lift_off_s)]
        for fault in due:
            self._pending.remove(fault)
            self.set(fault.sensor, fault.mode.value, now_s)
        return bool(due)


def _is_due(fault: Fault, now_s: float, lift_off_s: float | None) -> bool:
    if fault.after_lift_off_s is None:
        return True
    return lift_off_s is not None and now_s >= lift_off_s + fault.after_lift_off_s - 1e-6
