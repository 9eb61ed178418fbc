"""A real autopilot: how it is reached, checked before anything starts; and how ArduPilot's simulator is configured to fly our body."""

from __future__ import annotations

import socket
from dataclasses import dataclass
from pathlib import Path

import psutil

from alula.common.network import udp_port_is_free, udp_ports_of
from alula.runtime.live.spec import RequestError
from uav_simulator.ardupilot.protocol import PORT, PORTS_OF_INSTANCE, options
from uav_simulator.settings import FOLLOWED
from uav_simulator.world.config import WORLDS

CALLS, LISTENS = {"tcp", "udpout"}, {"tcpin", "udpin", "udp"}
HOW = "write tcp:HOST:PORT, udpin:HOST:PORT, udpout:HOST:PORT or a serial device as /dev/ttyACM0"
MOST_PORT = 65535

FIRST_MAVLINK_PORT = 5760  # TCP, of ArduPilot's simulator; as all its ports, 10 N above for the instance N
MOST_INSTANCE = 254
PARAMETERS = WORLDS / "hexacopter.parm"


@dataclass(frozen=True)
class Connection:
    """A MAVLink connection. ``kind``: tcp, tcpin, udp, udpin, udpout or serial; of a serial one ``host`` is the device."""

    text: str
    kind: str
    host: str
    port: int = 0

    @property
    def here(self) -> bool:
        """Return whether the peer that is called is a program of this machine."""
        return self.kind in CALLS and self.host in {"127.0.0.1", "localhost", "::1"}

    @property
    def refused(self) -> bool:
        """Return whether no program listens at an address of this machine, without connecting: the peer may take one client only."""
        if self.kind != "tcp" or not self.here:
            return False
        listening = (one for one in psutil.net_connections(kind="tcp") if one.status == psutil.CONN_LISTEN)
        return not any(one.laddr.port == self.port for one in listening)

    @property
    def instance(self) -> int | None:
        """Return which instance of ArduPilot's simulator has this as its first port, or one of the next nine; None: it can be any."""
        number = (self.port - FIRST_MAVLINK_PORT) // PORTS_OF_INSTANCE
        return number if self.kind == "tcp" and 0 <= number <= MOST_INSTANCE else None


def read_connection(text: str, said: str = "") -> Connection:
    """Read a connection; raises RequestError. ``said``: how it stands on the command line, if not as ``--autopilot``."""
    said = said or f"--autopilot {text}"
    kind, _, rest = text.partition(":")
    if kind not in CALLS | LISTENS:
        if not Path(text).is_absolute():
            raise RequestError(f"{said}: is no MAVLink connection; {HOW}")
        return Connection(text, "serial", text)
    host, _, port = rest.rpartition(":")
    if not host or ":" in host or not port.isdecimal() or not 0 < int(port) <= MOST_PORT:
        raise RequestError(f"{said}: needs a host and a port from 1 to {MOST_PORT}; {HOW}")
    return Connection(text, kind, host, int(port))


def check_connection(text: str, said: str = "") -> Connection:
    """Read a connection and check it as far as possible without connecting; raises RequestError."""
    said = said or f"--autopilot {text}"
    connection = read_connection(text, said)
    if connection.kind == "serial":
        _check_device(said, Path(connection.host))
        return connection
    try:
        socket.getaddrinfo(connection.host, connection.port)
    except (OSError, UnicodeError):
        raise RequestError(f"{said}: there is no host '{connection.host}'; {HOW}") from None
    if connection.kind in {"udpin", "udp"} and not udp_port_is_free(connection.port, connection.host):
        raise RequestError(f"{said}: UDP port {connection.port} can't be listened on: another program holds it, or the address is not ours")
    return connection


def _check_device(said: str, device: Path) -> None:
    if not device.exists():
        raise RequestError(f"{said}: there is no such device; is the autopilot plugged in? {HOW}")
    if not device.is_char_device():
        raise RequestError(f"{said}: is no serial device; {HOW}")


def read_sensors(text: str) -> str:
    """Check where a real autopilot's sensors come from, and return it."""
    if text in {"", "simulated"}:
        return text
    url = text.removeprefix(FOLLOWED)
    if url in {"", text}:
        raise RequestError(f"--sensors {text}: simulated, or {FOLLOWED}URL with a MAVLink connection as {FOLLOWED}udpin:127.0.0.1:14551")
    check_connection(url, f"--sensors {text}")
    return text


def body_port(connection: Connection, domain: int) -> int:
    """Return the UDP port where ArduPilot's simulator will look for the body: that of the instance, or one of this run alone.

    Raises RequestError when another program holds the port of the instance, NoFreePortError when all are held.
    """
    if connection.instance is None:
        return udp_ports_of(domain, first=PORT, step=PORTS_OF_INSTANCE)
    return check_body_port(PORT + PORTS_OF_INSTANCE * connection.instance, f"--autopilot {connection.text}")


def check_body_port(port: int, said: str) -> int:
    """Return the port when it is free; raises RequestError."""
    if not 0 < port <= MOST_PORT or not udp_port_is_free(port):
        raise RequestError(
            f"{said}: UDP port {port}, where ArduPilot would look for the body, can't be listened on; is it another flight's? "
            f"Start ArduPilot with another -I N, and give --autopilot tcp:127.0.0.1:{FIRST_MAVLINK_PORT} + 10 N"
        )
    return port


def command_of_ardupilot(connection: Connection, port: int) -> str:
    """Return the command line of an ArduPilot that looks for the body at a port."""
    return f"arducopter -w {options(port, connection.instance)} --speedup 100 --defaults copter.parm,{PARAMETERS}"
