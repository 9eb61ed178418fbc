"""What flies the body, for the node: a vehicle, its links, which are served while time waits, and the pilot's actions."""

from __future__ import annotations

import logging
import time
from typing import Protocol

from uav_simulator.ardupilot.protocol import options
from uav_simulator.ardupilot.vehicle import ArduPilotVehicle
from uav_simulator.autopilot.link_server import LinkServer
from uav_simulator.autopilot.params import parse_parameters
from uav_simulator.errors import ConfigError
from uav_simulator.flown import Flown, SimulatedAutopilotVehicle
from uav_simulator.following.vehicle import FollowedVehicle
from uav_simulator.frames import Vec3
from uav_simulator.imperfections import parse_imperfections
from uav_simulator.pilot_hooks import apply_pilot_word
from uav_simulator.settings import SimulatorSettings

log = logging.getLogger(__name__)


NAP_S = 0.002  # of what can't be woken
WOKEN_NAP_S = 0.05


class Pilot(Protocol):
    """Flies the body: the simulated autopilot, ArduPilot, or one elsewhere that is followed."""

    nap_s: float
    """The longest wait (wall clock) that lets time go on soon enough after it may: longer where ``wake`` ends it."""

    @property
    def flown(self) -> Flown:
        """The body and what flies it."""

    @property
    def ports(self) -> dict[str, int]:
        """The ports that it listens on, by the names of their parameters."""

    def serve(self, wait_s: float = 0.0) -> None:
        """Handle what has come over its links, or comes within ``wait_s`` seconds."""

    def wake(self) -> None:
        """End a wait of ``serve`` where that can be done; called from other threads."""

    def obey(self, word: str) -> None:
        """Execute a word of ``/sim/pilot``; raises ConfigError for one that can't be executed."""

    def close(self) -> None:
        """Close its sockets and connections."""


class SimulatedPilot:
    """The simulator's own autopilot, behind MAVLink."""

    nap_s = WOKEN_NAP_S

    def __init__(self, settings: SimulatorSettings, home: Vec3) -> None:
        self.flown = SimulatedAutopilotVehicle(
            seed=settings.seed,
            home=home,
            boot_before_s=settings.boot_before_s,
            params=parse_parameters(settings.autopilot_params),
            ground_link=settings.gcs_port >= 0,
            imperfections=parse_imperfections(settings.imperfections),
        )
        endpoints = (self.flown.endpoint, self.flown.ground_endpoint)
        self._links = LinkServer(*endpoints, port=settings.mavlink_port, gcs_port=settings.gcs_port)
        self.ports = {"mavlink_port": self._links.port}
        if settings.gcs_port >= 0:
            self.ports["gcs_port"] = self._links.gcs_port

    def serve(self, wait_s: float = 0.0) -> None:
        """Read and write MAVLink on all links; wait for at most ``wait_s`` (wall clock)."""
        self._links.serve(wait_s)

    def wake(self) -> None:
        """End a wait for MAVLink."""
        self._links.wake()

    def obey(self, word: str) -> None:
        """Flip the pilot's switch, move the stick, lose a link."""
        apply_pilot_word(word, self.flown.autopilot, self.flown.endpoint)

    def close(self) -> None:
        """Close the links and the connections of their clients."""
        self._links.close()


class ArduPilotPilot:
    """ArduPilot's own program, which the guidance speaks to directly."""

    nap_s = NAP_S

    def __init__(self, settings: SimulatorSettings, home: Vec3) -> None:
        self.flown = ArduPilotVehicle(seed=settings.seed, home=home, port=settings.ardupilot_port)
        self.ports = {"ardupilot_port": self.flown.port}
        log.info("the body waits for ArduPilot on UDP 127.0.0.1:%d (%s)", self.flown.port, options(self.flown.port))

    def serve(self, wait_s: float = 0.0) -> None:
        """Wait: packets are taken by the vehicle's tick alone, for each of them moves the body."""
        time.sleep(wait_s)

    def wake(self) -> None:
        """Do nothing: naps are short."""

    def obey(self, word: str) -> None:
        """Refuse: the pilot of a real autopilot has a remote control, or a ground station."""
        raise ConfigError(f"/sim/pilot: {word!r} is for the simulated autopilot; ArduPilot takes it over MAVLink")

    def close(self) -> None:
        """Close the UDP socket to ArduPilot."""
        self.flown.close()


class FollowedPilot:
    """An autopilot that flies elsewhere, with or without a simulator of its own; the guidance has another connection to it."""

    nap_s = NAP_S

    def __init__(self, settings: SimulatorSettings, home: Vec3) -> None:
        self.flown = FollowedVehicle(settings.followed_url, home)
        self.ports: dict[str, int] = {}

    def serve(self, wait_s: float = 0.0) -> None:
        """Read how far the autopilot has come, also while time waits for nodes."""
        until_s = time.monotonic() + wait_s
        while (rest_s := until_s - time.monotonic()) > 0.0:
            self.flown.listen(rest_s)

    def wake(self) -> None:
        """Do nothing: naps are short."""

    def obey(self, word: str) -> None:
        """Refuse: the pilot of a real autopilot has a remote control, or a ground station."""
        raise ConfigError(f"/sim/pilot: {word!r} is for the simulated autopilot; the one that is followed takes it from its own pilot")

    def close(self) -> None:
        """Close the connection to the autopilot."""
        self.flown.close()


def make_pilot(settings: SimulatorSettings, home: Vec3) -> Pilot:
    """Return the pilot that the settings name; raises SimulatorError when its port is taken, ConfigError for a home that it can't know."""
    if settings.vehicle != "simulated" and any(home):
        raise ConfigError(
            f"the world's `home` is ({home[0]:g}, {home[1]:g}, {home[2]:g}): a real autopilot measures from where it is switched on; "
            "write the world so that home is [0, 0, 0]"
        )
    if settings.followed_url:
        return FollowedPilot(settings, home)
    return ArduPilotPilot(settings, home) if settings.vehicle == "ardupilot" else SimulatedPilot(settings, home)
