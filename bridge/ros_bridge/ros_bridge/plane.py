"""The data plane: the native half that moves messages and calls, the ROS 1 node that finds peers for it, and the connection between them.

One thread hears the native half's events and tries publishers again that were lost. Another takes the few messages that Python sees:
those of its own endpoints, and those of types that the worlds lay out differently.
"""

from __future__ import annotations

import ctypes
import itertools
import logging
import threading
from collections import deque
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

from ros_bridge import native
from ros_bridge.addresses import bind_address, own_host, resolve
from ros_bridge.master import Connection
from ros_bridge.native import EventKind, Native, PythonMessage
from ros_bridge.publisher_links import PublisherLinks
from ros_bridge.ros1_node import Ros1Node
from ros_bridge.subscriber_links import SubscriberLinks

logger = logging.getLogger("ros_bridge")

LISTEN_MS = 250
RETRY_MS = 100
LOOKING_THREADS = 2
TOLD_ONCE = 100
Take = Callable[[PythonMessage, bytes], None]


class Plane:
    """The data plane of one process."""

    def __init__(self, library: Native, name: str, master: Connection) -> None:
        """Open both halves, as the node of that name."""
        self.native = library
        self._tokens = itertools.count(1)
        self._lock = threading.RLock()
        self._callers: dict[int, tuple[int, str]] = {}  # by their tokens, routes that call services in ROS 1
        self._takers: dict[int, Take] = {}
        self._names: dict[int, str] = {}
        self._told: deque[str] = deque(maxlen=TOLD_ONCE)
        self._closed = threading.Event()
        host = own_host()
        self.context = library.require(library.new(name.encode(), bind_address(host).encode()))
        self.links = PublisherLinks(library, self._tokens)
        self.node = Ros1Node(name, master, host=host, topics_port=library.port(self.context), changed=self.links.publishers_changed)
        self.subscribers = SubscriberLinks(master, library, self.context)
        self.links.node = self.subscribers.node = self.node
        # The master may hang: the threads that ask it do not hold up the one that takes events.
        self._lookers = ThreadPoolExecutor(LOOKING_THREADS, thread_name_prefix="plane_look")
        self._threads = [
            threading.Thread(target=self._listen, name="plane_events", daemon=True),
            threading.Thread(target=self._take_all, name="plane_python", daemon=True),
        ]
        for thread in self._threads:
            thread.start()

    def token(self, name: str) -> int:
        """Return a new number for a route, which its events carry."""
        number = next(self._tokens)
        self._names[number] = name
        return number

    def take_messages(self, token: int, take: Take) -> None:
        """Have a route's messages for Python taken by ``take``, in a thread of the plane; what it raises is logged."""
        self._takers[token] = take

    def take_no_messages(self, token: int) -> None:
        """End it; a message may still be under way."""
        self._takers.pop(token, None)

    def call(self, token: int, route: int, service: str) -> None:
        """Tell a native route where the server of a ROS 1 service is, whenever it asks."""
        with self._lock:
            self._callers[token] = (route, service)

    def call_no_more(self, token: int) -> None:
        """Tell it no more; when it returns the native route is not used any more."""
        with self._lock:
            self._callers.pop(token, None)

    def close(self) -> None:
        """End both halves; the routes have to be closed before."""
        self._closed.set()
        self.node.close()
        self.links.close()
        self.subscribers.close()
        self._lookers.shutdown(wait=False, cancel_futures=True)
        self.native.python_close(self.context)
        for thread in self._threads:
            thread.join()
        self.native.delete(self.context)

    def _take_all(self) -> None:
        message = PythonMessage()
        while not self._closed.is_set():
            if not self.native.python_next(self.context, LISTEN_MS, ctypes.byref(message)):
                continue
            try:
                take = self._takers.get(message.token)
                if take is not None:
                    take(message, ctypes.string_at(message.bytes, message.size) if message.size else b"")
            except Exception as error:  # noqa: BLE001 - whatever garbage a peer sends must not end this thread
                logger.error("%s: a message is ignored: %s: %s", self._names.get(message.token, "?"), type(error).__name__, error)
            finally:
                self.native.python_done(message.message)

    def _look(self, token: int, service: str) -> None:
        """Ask the master where a service's server is."""
        address, port, problem = b"", 0, "no server"
        try:
            place = self.node.place_of_service(service)
            if place is not None:
                address, port = resolve(*place)[0].encode(), place[1]
        except (OSError, ValueError, TypeError, LookupError) as error:  # it does not answer, or answers nonsense
            problem = f"no server can be reached: {error}"
        with self._lock:
            route, _ = self._callers.get(token, (None, ""))
            if route is None:
                return
            if address:
                self.native.service_found(route, address, port)
            else:
                self.native.service_not_found(route, problem.encode())

    def _listen(self) -> None:
        event = native.Event()
        while not self._closed.is_set():
            missing = self.links.try_again() | self.subscribers.try_again()
            if self.native.next_event(self.context, RETRY_MS if missing else LISTEN_MS, ctypes.byref(event)):
                self._hear(EventKind(event.kind), event.token, ctypes.string_at(event.text, event.size))

    def _hear(self, kind: EventKind, token: int, content: bytes) -> None:
        text = content.decode(errors="replace")
        if kind in {EventKind.OTHER_VERSION, EventKind.NOT_PUBLISHED}:
            self.subscribers.on_header(kind, content)
        elif kind is EventKind.BAD_PEER and text not in self._told:
            self._told.append(text)
            logger.warning("a ROS 1 peer was turned away: %s", text)
        elif kind is EventKind.BAD_MESSAGE:
            logger.error("%s: %s can't be converted", self._names.get(token, "?"), text)
        elif kind is EventKind.CALL_FAILED:
            logger.warning("call failed: %s", text)
        elif kind is EventKind.NEEDS_SERVER:
            with self._lock:
                if token in self._callers:
                    self._lookers.submit(self._look, token, self._callers[token][1])
        elif kind >= EventKind.SUBSCRIBED:
            self.subscribers.on_event(kind, text)
        else:
            self.links.on_event(kind, token, text)
