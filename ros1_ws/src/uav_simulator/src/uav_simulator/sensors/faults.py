"""The modes of the sensors: the ways in which each can fail, and when they do."""

from __future__ import annotations

import threading
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from enum import Enum

from alula.common.faults import FaultRequest
from alula.common.located_yaml import choices
from uav_simulator.errors import ConfigError


class SensorMode(Enum):
    """What a sensor's driver publishes."""

    OK = "ok"
    DEAD = "dead"  # nothing
    FROZEN = "frozen"  # the last measurement again and again, with new stamps
    FLICKERING = "flickering"  # frozen but for one value that changes
    BLACK = "black"  # measurements without content: images of zeros, no returns, zero rates and forces
    DARK = "dark"  # images of next to no light and the sensor's noise
    WHITE = "white"  # overexposed images
    BLURRED = "blurred"  # images out of focus
    SHIFTED = "shifted"  # the right image 3 pixels lower
    ROTATED = "rotated"  # the right image turned by 1 degree
    SWAPPED = "swapped"  # left and right exchanged
    WRONG_INFO = "wrong_info"  # infos of twice the resolution
    THINNED = "thinned"  # one point of 500
    SECTOR = "sector"  # no returns from the front half
    BIASED = "biased"  # ranges 0.5 m too long; rates off by 0.09 rad/s and forces by 0.9 m/s2
    LATE = "late"  # arrives half a second after its stamp
    FUTURE = "future"  # stamps ten seconds ahead
    DRIFTING = "drifting"  # the autopilot's height runs away by 0.015 m/s, up or down depending on the seed
    JAMMED = "jammed"  # a GPS that says that it has no fix
    STOPPED = "stopped"  # one motor of six carries nothing: the vehicle falls, and stays armed on the ground, "Potential Thrust Loss (1)"
    STRONG = "strong"  # it rises to 8 m/s with gusts of 1.5 m/s within 3 s, and calms down in the end
    TAKES = "takes"  # the pilot takes the vehicle by LOITER, and gives it back by GUIDED in the end
    LANDS = "lands"  # the pilot takes it by LAND, and gives it back by GUIDED in the end
    STICK = "stick"  # the pilot turns the nose by the stick, at 0.5 rad/s


_ALWAYS = (SensorMode.DEAD, SensorMode.FROZEN, SensorMode.FLICKERING, SensorMode.BLACK, SensorMode.LATE, SensorMode.FUTURE)
_IMAGES = (
    SensorMode.DARK,
    SensorMode.WHITE,
    SensorMode.BLURRED,
    SensorMode.SHIFTED,
    SensorMode.ROTATED,
    SensorMode.SWAPPED,
    SensorMode.WRONG_INFO,
)
FAULTS: dict[str, tuple[str, ...]] = {
    "zed": tuple(mode.value for mode in (*_ALWAYS, *_IMAGES)),
    "lidar": tuple(mode.value for mode in (*_ALWAYS, SensorMode.THINNED, SensorMode.SECTOR, SensorMode.BIASED)),
    "camera": tuple(mode.value for mode in _ALWAYS if mode is not SensorMode.FLICKERING),
    "imu": tuple(mode.value for mode in (*_ALWAYS, SensorMode.BIASED)),
    "barometer": (SensorMode.DRIFTING.value,),
    "gps": (SensorMode.DEAD.value, SensorMode.JAMMED.value),
    "motor": (SensorMode.STOPPED.value,),
    "wind": (SensorMode.STRONG.value,),
    "pilot": (SensorMode.TAKES.value, SensorMode.LANDS.value, SensorMode.STICK.value),
}
"""The sensors, each with the ways in which it can fail; the first one counts where none is named. Barometer and GPS are the autopilot's.
Motor, wind and pilot are no sensors, but come and go alike."""
AUTOPILOTS = {
    "barometer": "set ArduPilot's SIM_BARO_DRIFT",
    "gps": "set ArduPilot's SIM_GPS1_ENABLE (SIM_GPS_DISABLE in older ones)",
    "wind": "set ArduPilot's SIM_WIND_SPD, or --imperfections wind_m_s=8",
    "pilot": "use its remote control, or a ground station",
}
"""Those of the autopilot and around it, each with what to do where ArduPilot flies."""


@dataclass(frozen=True)
class FaultRecord:
    """A change of a mode, at a moment of the simulated clock."""

    sensor: str
    mode: SensorMode
    t_s: float


@dataclass(frozen=True)
class _Change:
    sensor: str
    mode: SensorMode
    after_lift_off_s: float | None


class SensorBoard:
    """The sensors' modes. Set from a service's thread, read from the simulation's."""

    def __init__(self, faults: Sequence[FaultRequest], *, absent: Collection[str] = ()) -> None:
        """``faults`` of the sensors, as `alula.common.faults` reads them with FAULTS; ``absent``: those that can't be broken here."""
        self._absent = absent
        for fault in faults:
            self._check(fault.what)
        self._lock = threading.Lock()
        self._modes = dict.fromkeys(FAULTS, SensorMode.OK)
        self._pending = [change for fault in faults for change in _changes(fault)]
        self._records: list[FaultRecord] = []

    def mode(self, sensor: str) -> SensorMode:
        """Return the mode of a sensor: OK, or the way in which it fails."""
        with self._lock:
            return self._modes[sensor]

    @property
    def modes(self) -> dict[str, str]:
        """Return all modes by name."""
        with self._lock:
            return {sensor: mode.value for sensor, mode in self._modes.items()}

    @property
    def records(self) -> list[FaultRecord]:
        """Return the changes so far, in order."""
        with self._lock:
            return list(self._records)

    def set(self, sensor: str, mode: str, t_s: float) -> None:
        """Break or mend a sensor at a moment of the simulated clock; raises ConfigError for a wrong name."""
        if sensor not in FAULTS:
            raise ConfigError(f"unknown sensor {sensor!r}; known are {choices(sensor, FAULTS)}")
        self._check(sensor)
        known = (SensorMode.OK.value, *FAULTS[sensor])
        if mode not in known:
            raise ConfigError(f"{sensor} has no mode {mode!r}; it has {choices(mode, known)}")
        with self._lock:
            self._modes[sensor] = SensorMode(mode)
            self._records.append(FaultRecord(sensor, SensorMode(mode), t_s))

    def _check(self, sensor: str) -> None:
        if sensor in self._absent:
            raise ConfigError(f"no fault of the {sensor}: it is the autopilot's, which is not simulated; {AUTOPILOTS[sensor]}")

    def apply_due(self, now_s: float, lift_off_s: float | None) -> bool:
        """Apply the scheduled changes that are due; return whether there was one."""
        due = [change for change in self._pending if _is_due(change, now_s, lift_off_s)]
        for change in due:
            self._pending.remove(change)
            self.set(change.sensor, change.mode.value, now_s)
        return bool(due)


def _changes(fault: FaultRequest) -> list[_Change]:
    """Return the beginning of a fault, and its end if it has one."""
    begin = _Change(fault.what, SensorMode(fault.how or FAULTS[fault.what][0]), fault.begin_s)
    return [begin] if fault.end_s is None else [begin, _Change(fault.what, SensorMode.OK, fault.end_s)]


def _is_due(change: _Change, now_s: float, lift_off_s: float | None) -> bool:
    if change.after_lift_off_s is None:
        return True
    return lift_off_s is not None and now_s >= lift_off_s + change.after_lift_off_s - 1e-6
