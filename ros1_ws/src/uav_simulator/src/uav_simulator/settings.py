"""The node's parameters with their defaults; an unknown private parameter is an error."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

from uav_simulator.errors import ConfigError

VEHICLES = ("simulated", "ardupilot")
FOLLOWED = "followed:"


@dataclass(frozen=True)
class SimulatorSettings:
    """Private parameters of the node."""

    seed: int = 0
    world: str = "yard"  # name of a world that comes with the simulator, or a world file
    world_path: str = ""  # where the true surfaces are written as PLY; empty: nowhere
    faults: str = ""  # between commas; how each is written: alula.common.faults, what there is: sensors.faults
    # The body's autopilot: simulated (the simulator's own autopilot), ardupilot (its JSON interface), or followed:URL (it is where the
    # autopilot at a MAVLink connection says, on that one's clock).
    vehicle: str = "simulated"
    ardupilot_port: int = 9002  # UDP on loopback, where ArduPilot's motor outputs come: 9002 + 10 x its instance
    imperfections: str = "off"  # off, realistic, or NAME=VALUE,... as in imperfections.py
    mavlink_port: int = 5760  # TCP on loopback, for the companion; 0: any free one, which the parameter then tells
    gcs_port: int = -1  # UDP on loopback, for a ground station; 0: any free one, which the parameter then tells; -1: one is made up
    autopilot_params: str = ""  # NAME=VALUE,... on top of autopilot.params.DEFAULTS, for example FS_GCS_ENABLE=1
    rate: float = 1.0  # simulated seconds per second at most; 0: as fast as it can
    pace_topics: tuple[str, ...] = ()  # simulated time waits for them: TOPIC, or TOPIC=SENSOR of a node that deals with its measurements
    pace_limit_s: float = 0.3
    pace_timeout_s: float = 15.0  # wall clock; a node that hangs is waited for so long, one that has died is not
    start_timeout_s: float = 45.0  # wall clock; time begins when all of pace_topics are advertised, and then without them
    boot_before_s: float = 60.0  # how long the autopilot has had power when the clock starts

    @property
    def followed_url(self) -> str:
        """The address of the autopilot that the sensors follow; empty when there is none."""
        return self.vehicle.removeprefix(FOLLOWED) if self.vehicle.startswith(FOLLOWED) else ""


def settings_from_params(params: dict[str, Any]) -> SimulatorSettings:
    """Read and check parameters; raises ConfigError naming the wrong one."""
    types = {f.name: type(getattr(SimulatorSettings(), f.name)) for f in fields(SimulatorSettings)}
    unknown = sorted(set(params) - set(types))
    if unknown:
        raise ConfigError(f"unknown parameter ~{unknown[0]}; known are {', '.join(types)}")
    values = {name: _converted(name, value, types[name]) for name, value in params.items()}
    settings = SimulatorSettings(**values)
    for name in ("seed", "rate", "pace_limit_s", "pace_timeout_s", "start_timeout_s", "boot_before_s"):
        if getattr(settings, name) < 0:
            raise ConfigError(f"parameter ~{name}: {getattr(settings, name)} must not be negative")
    if settings.vehicle not in VEHICLES and not settings.followed_url:
        raise ConfigError(f"parameter ~vehicle: {settings.vehicle!r} is none of {', '.join(VEHICLES)}, {FOLLOWED}URL")
    return settings


def _converted(name: str, value: Any, kind: type) -> Any:
    """Return the value in its type; a list of topics may also come as words between commas or blanks."""
    try:
        if kind is tuple:
            return tuple(value.replace(",", " ").split() if isinstance(value, str) else (str(v) for v in value))
        converted = kind(value)
    except (TypeError, ValueError):
        converted = None
    if converted is None or isinstance(value, bool) or (kind is int and float(value) != converted):
        raise ConfigError(f"parameter ~{name}: {value!r} is no {kind.__name__}")
    return converted
