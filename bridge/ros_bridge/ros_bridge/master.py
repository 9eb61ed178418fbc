"""The client of the ROS 1 master, and the only module that talks to it: one thread polls its state, other calls are made once.

The master calls nodes when the publishers of a topic or parameters change (``ros1_node``), but not when it was restarted, nor when topics,
subscribers or services come and go. So ``getSystemState`` is asked for five times a second on a kept connection. The answer is not even
parsed while it is the same: whether the master is there, whether it still knows this node and whether the graph has changed are seen in it.
"""

from __future__ import annotations

import http.client
import logging
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol, cast
from urllib.parse import urlsplit
from xml.parsers.expat import ExpatError
from xmlrpc.client import Error as XmlRpcError
from xmlrpc.client import dumps, loads

logger = logging.getLogger("ros_bridge")

ANSWER_WITHIN_S = 1.0
ASK_EVERY_S = 0.2
OK = 1
HEADERS = {"Content-Type": "text/xml", "Connection": "keep-alive"}


class RefusedError(OSError):
    """A master or node has answered, and says no."""


class SilentError(OSError):
    """A master or node has not answered in time."""


class Connection:
    """XML-RPC over a connection that is kept between calls; safe from several threads, which wait for each other."""

    def __init__(self, uri: str, within_s: float = ANSWER_WITHIN_S) -> None:
        """Remember the address; the first call connects. Raises OSError when the URI has no host and port."""
        parts = urlsplit(uri)
        try:
            self._http = http.client.HTTPConnection(parts.hostname or "localhost", parts.port or 80, timeout=within_s)
        except ValueError as error:
            raise OSError(f"'{uri}' is no address of a node: {error}") from error
        self.uri = uri
        self._lock = threading.Lock()

    def call_raw(self, method: str, *arguments: Any) -> bytes:
        """Call a method and return the answer as it came; raises OSError."""
        body = dumps(arguments, method, allow_none=True)
        with self._lock:
            fresh = self._http.sock is None
            try:
                return self._exchange(body)
            except TimeoutError as error:
                raise SilentError(f"{self.uri}: {error}") from error
            except (OSError, http.client.HTTPException) as error:
                if fresh:
                    raise OSError(f"{self.uri}: {error or type(error).__name__}") from error
            try:
                return self._exchange(body)  # a kept connection may have been closed meanwhile
            except (OSError, http.client.HTTPException) as error:
                raise OSError(f"{self.uri}: {error or type(error).__name__}") from error

    def _exchange(self, body: str) -> bytes:
        try:
            self._http.request("POST", "/RPC2", body, HEADERS)
            return self._http.getresponse().read()
        except BaseException:
            self._http.close()
            raise

    def call(self, method: str, *arguments: Any) -> Any:
        """Call a method and return the value of its answer.

        Raises:
            RefusedError: It says no.
            OSError: It does not answer, or with garbage.
        """
        return value_of(self.call_raw(method, *arguments), self.uri)

    def close(self) -> None:
        """Close the connection; the next call opens it again."""
        with self._lock:
            self._http.close()


def value_of(answer: bytes, uri: str) -> Any:
    """Return the value in an answer ``[code, text, value]`` of the master or slave API; raises as ``Connection.call``."""
    try:
        code, text, value = cast("Any", loads(answer)[0][0])
    except (XmlRpcError, ExpatError, ValueError, IndexError, TypeError) as error:
        raise OSError(f"{uri}: the answer can't be read: {error}") from error
    if code != OK:
        raise RefusedError(f"{uri}: {text}")
    return value


def call_node(uri: str, method: str, *arguments: Any, within_s: float) -> Any:
    """Call a method of a node, on a connection of its own; raises as ``Connection.call``."""
    connection = Connection(uri, within_s)
    try:
        return connection.call(method, *arguments)
    finally:
        connection.close()


def wait_for_master(master: Connection, caller_id: str, stop: threading.Event) -> bool:
    """Wait until the master answers, saying so once; False when asked to stop before."""
    said = False
    while not answers(master, caller_id):
        if not said:
            logger.warning("waiting for a ROS master at %s", master.uri)
            said = True
        if stop.wait(ASK_EVERY_S / 2):
            return False
    if said:
        logger.info("the ROS master is there")
    return True


def answers(master: Connection, caller_id: str) -> bool:
    """Return whether a master answers."""
    try:
        master.call("getPid", caller_id)
    except OSError:
        return False
    return True


class Registrations(Protocol):
    """What the monitor needs of the node."""

    name: str

    def register_again(self, *, only_untold: bool = False) -> None:
        """Tell the master everything, or what it has not heard yet."""


@dataclass(frozen=True)
class MasterState:
    """What is known of the master. ``system``: its last answer to ``getSystemState``; ``losses``: how often it went or was restarted."""

    reachable: bool = True
    system: bytes = b""
    losses: int = 0


class MasterMonitor:
    """The thread that asks the master, has the node registered again when the master has forgotten it, and tells of changes."""

    def __init__(self, master: Connection, node: Registrations) -> None:
        """Get ready. The thread calls ``on_reachable`` when the master comes or goes, and ``on_graph`` when the graph changes."""
        self._master = master
        self._node = node
        self._own_name = f"<string>{node.name}</string>".encode()
        self._stop = threading.Event()
        self.state = MasterState()
        self.on_reachable: Callable[[], None] = lambda: None
        self.on_graph: Callable[[], None] = lambda: None
        self._thread = threading.Thread(target=self._run, name="master_monitor", daemon=True)

    def start(self) -> None:
        """Start the thread that asks the master."""
        self._thread.start()

    def _run(self) -> None:
        while True:
            try:
                self.look()
            except Exception:  # whatever garbage comes from there; the next look must come
                logger.exception("reading the state of the ROS master failed")
            if self._stop.wait(ASK_EVERY_S):
                return

    def look(self) -> None:
        """Ask the master once, and tell what has changed; the thread does so again and again."""
        before = self.state
        try:
            system = self._master.call_raw("getSystemState", self._node.name)
            if system != before.system:
                value_of(system, self._master.uri)
        except OSError:
            self.state = MasterState(False, before.system, before.losses + before.reachable)
            self._tell_reachable(before)
            return
        forgotten = self._own_name not in system
        self.state = MasterState(True, system, before.losses + (forgotten and before.reachable))
        self._tell_reachable(before)
        if forgotten and before.system and not self._stop.is_set():
            logger.warning("the ROS master has forgotten %s (it was restarted): registering everything again", self._node.name)
        self._node.register_again(only_untold=not forgotten)
        if system != before.system:
            self.on_graph()

    def _tell_reachable(self, before: MasterState) -> None:
        if before.reachable != self.state.reachable:
            logger.warning("the ROS master at %s %s", self._master.uri, "is back" if self.state.reachable else "does not answer")
            self.on_reachable()

    def close(self) -> None:
        """Stop the thread; wait for it for ``ANSWER_WITHIN_S`` at most."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join(ANSWER_WITHIN_S)
