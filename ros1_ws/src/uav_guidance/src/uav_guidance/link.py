"""The MAVLink connection: a thread that reads, reconnects and never gives up, and a way to send."""

from __future__ import annotations

import contextlib
import logging
import threading
from collections.abc import Callable
from typing import Any

from pymavlink import mavutil
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from uav_guidance.encoding import COMPANION_COMPONENT, COMPANION_SYSTEM, from_autopilot_to_us

log = logging.getLogger(__name__)

READ_WAIT_S = 0.2
FIRST_RETRY_S, LONGEST_RETRY_S = 0.2, 2.0


class LinkClosedError(ConnectionError):
    """The other side closed the connection."""


class Link:
    """A MAVLink 2 connection to the autopilot (system and component 1/1), as its companion (1/191).

    ``on_message``, ``on_connect`` and ``on_idle`` (all that has arrived has been handed over, or the connection has ended) are called
    in the reader's thread; ``send`` may be called from any thread.
    """

    def __init__(
        self,
        url: str,
        baud: int,
        *,
        on_message: Callable[[Any], None],
        on_connect: Callable[[], None],
        on_idle: Callable[[], None],
    ) -> None:
        self._url, self._baud = url, baud
        self._on_message, self._on_connect, self._on_idle = on_message, on_connect, on_idle
        self._reading = False
        self._ended = threading.Event()
        self._sending = threading.Lock()
        self._port: Any = None
        self._mav: Any = None
        self._thread = threading.Thread(target=self._run, name="mavlink", daemon=True)

    def start(self) -> None:
        """Begin to connect and to read."""
        self._thread.start()

    @property
    def idle(self) -> bool:
        """Whether all that has arrived has been handed over; also true without a connection."""
        port = self._port
        try:
            return not self._reading and (port is None or not port.select(0.0))
        except (OSError, ValueError):  # the reader has just closed it
            return True

    def close(self) -> None:
        """End the thread and the connection."""
        self._ended.set()
        self._thread.join(2.0 * READ_WAIT_S + 1.0)

    def send(self, message: Any) -> None:
        """Send a message; without a connection it is lost, for what matters is repeated."""
        with self._sending:
            if self._mav is not None:
                with contextlib.suppress(OSError):
                    self._mav.send(message)

    def _run(self) -> None:
        retry_s, told = FIRST_RETRY_S, ""
        while not self._ended.is_set():
            try:
                self._connect()
                retry_s, told = FIRST_RETRY_S, ""
                self._read()
            except (OSError, ValueError) as error:
                if told != str(error):
                    log.warning("autopilot at %s: %s; trying again", self._url, error)
                told = str(error)
            finally:
                self._disconnect()
            if not self._ended.is_set():
                self._on_idle()  # the end of a connection is the last that arrives on it
            self._ended.wait(retry_s)
            retry_s = min(2.0 * retry_s, LONGEST_RETRY_S)

    def _connect(self) -> None:
        port = mavutil.mavlink_connection(self._url, baud=self._baud, retries=0)
        # pymavlink prints and goes on when a TCP peer closes; here that ends the connection.
        port.handle_eof = port.handle_disconnect = self._closed
        mav = mavlink.MAVLink(port, srcSystem=COMPANION_SYSTEM, srcComponent=COMPANION_COMPONENT)
        mav.robust_parsing = True
        with self._sending:
            self._port, self._mav = port, mav
        log.info("connected to the autopilot at %s", self._url)
        self._on_connect()

    def _disconnect(self) -> None:
        with self._sending:
            port, self._port, self._mav = self._port, None, None
        if port is not None:
            with contextlib.suppress(OSError):
                port.close()

    def _read(self) -> None:
        while not self._ended.is_set():
            if not self._port.select(READ_WAIT_S):
                continue
            self._reading = True  # before the bytes leave the socket: in between, the link must not look idle
            try:
                self._read_once()
            finally:
                self._reading = False
            if self.idle:
                self._on_idle()

    def _read_once(self) -> None:
        data = self._port.recv(4096)
        for message in (self._mav.parse_buffer(data) if data else None) or ():
            if from_autopilot_to_us(message):
                self._take(message)

    def _take(self, message: Any) -> None:
        try:
            self._on_message(message)
        except Exception:  # one message must not end the link
            log.exception("a message of the autopilot is left out: %s", message)

    @staticmethod
    def _closed() -> None:
        raise LinkClosedError("the connection was closed")
