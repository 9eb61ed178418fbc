"""The data plane: the native half that moves messages and calls, the ROS 1 node that finds peers for it, and what holds them together.

One thread hears the native half's events and tries publishers again that were lost; questions to publishers and to the master, which may
hang, are asked by a few threads more. No message is ever seen by Python.
"""

from __future__ import annotations

import ctypes
import itertools
import logging
import socket
import threading
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field

from ros_bridge import native, two_worlds
from ros_bridge.native import EventKind, Native
from ros_bridge.ros1_node import Ros1Node

two_worlds.import_ros1()

import rosgraph.network  # noqa: E402 - only after ROS 1 is there

logger = logging.getLogger("ros_bridge")

NODE_SUFFIX = "_topics"
ASKING_THREADS = 4
LISTEN_MS = 250
RETRY_MS = 100
LOOKING_THREADS = 2
TOLD_ONCE = 100
FIRST_RETRY_S, LAST_RETRY_S, REFUSED_RETRY_S = 0.1, 1.0, 5.0


@dataclass
class _Link:
    """A connection to a publisher, made or wanted."""

    route: int
    topic: str
    uri: str
    token: int
    connected: bool = False
    under_way: bool = False
    failures: int = 0
    next_try_s: float = 0.0
    complaint: str = ""


@dataclass
class _Subscription:
    topic: str
    publishers: set[str] = field(default_factory=set)
    links: dict[str, _Link] = field(default_factory=dict)


class Plane:
    """The data plane of one process."""

    def __init__(self, library: Native, caller_id: str, master_uri: str, own_uris: Callable[[], set[str]]) -> None:
        """Open both halves. ``own_uris`` tells which nodes are ours: what they publish is never fetched back."""
        self.native = library
        self._own_uris = own_uris
        self._tokens = itertools.count(1)
        self._lock = threading.RLock()
        self._subscriptions: dict[int, _Subscription] = {}  # by the native route's address
        self._links: dict[int, _Link] = {}
        self._callers: dict[int, tuple[int, str]] = {}  # by their tokens, routes that call services in ROS 1
        self._names: dict[int, str] = {}
        self._told: deque[str] = deque(maxlen=TOLD_ONCE)
        self._closed = threading.Event()
        bind_address = rosgraph.network.get_bind_address()
        self.machinery = library.require(library.new((caller_id + NODE_SUFFIX).encode(), (bind_address or "0.0.0.0").encode()))  # noqa: S104
        self.node = Ros1Node(
            caller_id + NODE_SUFFIX,
            master_uri,
            host=rosgraph.network.get_host_name(),
            bind_address=bind_address,
            topics_port=library.port(self.machinery),
            changed=self._publishers_changed,
        )
        self._askers = ThreadPoolExecutor(ASKING_THREADS, thread_name_prefix="plane_ask")
        # Of their own, so that calls do not wait behind questions to publishers that hang.
        self._lookers = ThreadPoolExecutor(LOOKING_THREADS, thread_name_prefix="plane_look")
        self._listener = threading.Thread(target=self._listen, name="plane_events", daemon=True)
        self._listener.start()

    def token(self, name: str) -> int:
        """Return a new number for a route, which its events carry."""
        with self._lock:
            number = next(self._tokens)
            self._names[number] = name
            return number

    def subscribe(self, topic: str, type_name: str, route: int) -> None:
        """Connect a native route to all publishers of a ROS 1 topic, now and later."""
        with self._lock:
            self._subscriptions[route] = _Subscription(topic)
        self.node.subscribe(topic, type_name)

    def unsubscribe(self, route: int) -> None:
        """Connect no more; when it returns nobody uses the native route."""
        with self._lock:
            subscription = self._subscriptions.pop(route, None)
            if subscription is None:
                return
            for link in subscription.links.values():
                self._links.pop(link.token, None)
            others = any(other.topic == subscription.topic for other in self._subscriptions.values())
        if not others:
            self.node.unsubscribe(subscription.topic)

    def call(self, token: int, route: int, service: str) -> None:
        """Tell a native route where the server of a ROS 1 service is, whenever it asks."""
        with self._lock:
            self._callers[token] = (route, service)

    def call_no_more(self, token: int) -> None:
        """Tell it no more; when it returns nobody uses the native route."""
        with self._lock:
            self._callers.pop(token, None)

    def register_again(self) -> None:
        """Tell a master that has forgotten us everything."""
        self.node.register_again()

    def close(self) -> None:
        """End both halves; the routes have to be closed before."""
        self._closed.set()
        self.node.close()
        for threads in (self._askers, self._lookers):
            threads.shutdown(wait=False, cancel_futures=True)
        self._listener.join()
        with self._lock:
            self.native.delete(self.machinery)

    def _publishers_changed(self, topic: str, uris: list[str]) -> None:
        publishers = set(uris) - self._own_uris() - {self.node.uri}
        with self._lock:
            for route, subscription in self._subscriptions.items():
                if subscription.topic == topic:
                    self._connect_all(route, subscription, publishers)

    def _connect_all(self, route: int, subscription: _Subscription, publishers: set[str]) -> None:
        """Connect to those that are new. The others' connections end when they close them: a restarted master does not know all at once."""
        subscription.publishers = publishers
        for uri in publishers - subscription.links.keys():
            link = _Link(route, subscription.topic, uri, next(self._tokens))
            subscription.links[uri] = link
            self._links[link.token] = link
            self._try(link)

    def _try(self, link: _Link) -> None:
        """Ask the publisher where to connect to, in another thread."""
        link.under_way = True
        if not self._closed.is_set():
            self._askers.submit(self._connect, link)

    def _connect(self, link: _Link) -> None:
        try:
            host, port = self.node.place_of(link.topic, link.uri)
            address = str(socket.getaddrinfo(host, port, socket.AF_INET, socket.SOCK_STREAM)[0][4][0])
        except (OSError, ValueError, TypeError, LookupError) as error:  # it does not answer, or answers nonsense
            self._failed(link, str(error), refused=False)
            return
        with self._lock:
            wanted = link.route in self._subscriptions and link.token in self._links
            if wanted and not self.native.up_connect(link.route, link.token, address.encode(), port):
                self._failed(link, self.native.error().decode(errors="replace"), refused=False)

    def _look(self, token: int, service: str) -> None:
        """Ask the master where a service's server is, in another thread."""
        address, port, problem = "", 0, "no server"
        try:
            place = self.node.place_of_service(service)
            if place is not None:
                port = place[1]
                address = str(socket.getaddrinfo(place[0], port, socket.AF_INET, socket.SOCK_STREAM)[0][4][0])
        except (OSError, ValueError, TypeError, LookupError) as error:  # it does not answer, or answers nonsense
            problem = f"no server can be reached: {error}"
        with self._lock:
            route, _ = self._callers.get(token, (None, ""))
            if route is None:
                return
            if address:
                self.native.service_found(route, address.encode(), port)
            else:
                self.native.service_not_found(route, problem.encode())

    def _failed(self, link: _Link, reason: str, *, refused: bool) -> None:
        """Try again later, unless the publisher is gone by the master's word."""
        with self._lock:
            subscription = self._subscriptions.get(link.route)
            if subscription is None or link.token not in self._links:
                return
            if refused and link.complaint != reason:
                link.complaint = reason
                logger.warning("%s: the publisher at %s is not bridged: %s", link.topic, link.uri, reason)
            link.connected = link.under_way = False
            if link.uri not in subscription.publishers:
                del subscription.links[link.uri]
                del self._links[link.token]
                return
            pause_s = REFUSED_RETRY_S if refused else min(FIRST_RETRY_S * 2**link.failures, LAST_RETRY_S)
            link.failures = min(link.failures + 1, 10)
            link.next_try_s = time.monotonic() + pause_s

    def _listen(self) -> None:
        event = native.Event()
        while not self._closed.is_set():
            waiting = any(not link.connected for link in list(self._links.values()))
            if self.native.next_event(self.machinery, RETRY_MS if waiting else LISTEN_MS, ctypes.byref(event)):
                self._hear(EventKind(event.kind), event.token, event.text.decode(errors="replace"))
            self._try_again()

    def _try_again(self) -> None:
        self.node.register_again(only_untold=True)
        now_s = time.monotonic()
        with self._lock:
            for link in self._links.values():
                if not link.connected and not link.under_way and now_s >= link.next_try_s:
                    self._try(link)

    def _hear(self, kind: EventKind, token: int, text: str) -> None:
        if kind is EventKind.BAD_PEER and text not in self._told:
            self._told.append(text)
            logger.warning("a ROS 1 peer was turned away: %s", text)
        if kind is EventKind.BAD_MESSAGE:
            logger.error("%s: %s can't be converted", self._names.get(token, "?"), text)
        if kind is EventKind.CALL_FAILED:
            logger.warning("call failed: %s", text)
        with self._lock:
            if kind is EventKind.NEEDS_SERVER and token in self._callers:
                self._lookers.submit(self._look, token, self._callers[token][1])
            link = self._links.get(token)
            if link is None:
                return
            if kind is EventKind.CONNECTED:
                link.connected, link.under_way, link.failures, link.complaint = True, False, 0, ""
            elif kind is EventKind.NEEDS_WRITER:
                self.native.up_grant(link.route, token)
            elif kind in {EventKind.CLOSED, EventKind.REFUSED}:
                self._failed(link, text, refused=kind is EventKind.REFUSED)


def open_plane(caller_id: str, master_uri: str, own_uris: Callable[[], set[str]]) -> Plane | None:
    """Return the data plane, or None when its library was not built: then rospy and rclpy carry the messages."""
    path = native.find_library()
    if path is None:
        logger.warning("%s is not built: messages go through Python, at a tenth of the speed", native.LIBRARY)
        return None
    return Plane(Native(path), caller_id, master_uri, own_uris)
