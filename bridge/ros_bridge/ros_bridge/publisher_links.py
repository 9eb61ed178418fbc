"""Connections of the data plane to publishers in ROS 1: to all that the master names, tried again as long as it names them.

Each node is asked by one thread at a time, for all its topics in a row: a node that hangs holds up its own topics and no others.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from ros_bridge.addresses import resolve
from ros_bridge.master import RefusedError
from ros_bridge.native import EventKind, Native
from ros_bridge.ros1_node import Kind

if TYPE_CHECKING:
    from ros_bridge.ros1_node import Ros1Node

logger = logging.getLogger("ros_bridge")

ASKING_THREADS = 32
FIRST_RETRY_S, LAST_RETRY_S, REFUSED_RETRY_S = 0.1, 0.5, 5.0


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
    type_name: str
    publishers: set[str] = field(default_factory=set)
    links: dict[str, _Link] = field(default_factory=dict)


class PublisherLinks:
    """All connections to publishers. Safe from several threads; ``node`` has to be set before the first subscription."""

    node: Ros1Node

    def __init__(self, library: Native, tokens: Iterator[int]) -> None:
        """``tokens`` gives numbers that no event of another kind carries."""
        self._native = library
        self._tokens = tokens
        self._lock = threading.RLock()
        self._subscriptions: dict[int, _Subscription] = {}  # by the native route's address
        self._links: dict[int, _Link] = {}  # those of subscriptions, and those that are about to be replaced
        self._asked: set[str] = set()  # nodes
        self.on_refused: Callable[[str], None] = lambda _: None  # the topic: its publisher has another type, or another version of it
        self._closed = False
        self._askers = ThreadPoolExecutor(ASKING_THREADS, thread_name_prefix="plane_ask")

    def subscribe(self, topic: str, type_name: str, route: int) -> None:
        """Connect a native route to all publishers of a ROS 1 topic, now and later."""
        with self._lock:
            self._subscriptions[route] = _Subscription(topic, type_name)
        self.node.register(Kind.SUBSCRIBER, topic, type_name)

    def unsubscribe(self, route: int) -> None:
        """Connect no more; when it returns the native route is not used any more."""
        with self._lock:
            subscription = self._subscriptions.pop(route, None)
            if subscription is None:
                return
            self._links = {token: link for token, link in self._links.items() if link.route != route}
        self.node.unregister(Kind.SUBSCRIBER, subscription.topic, subscription.type_name)

    def publishers_changed(self, topic: str, uris: list[str]) -> None:
        """Take the master's list of a topic's publishers. What the bridge itself publishes is never fetched back."""
        publishers = set(uris) - {self.node.uri}
        with self._lock:
            for route, subscription in self._subscriptions.items():
                if subscription.topic == topic:
                    self._connect_all(route, subscription, publishers)

    def _connect_all(self, route: int, subscription: _Subscription, publishers: set[str]) -> None:
        """Connect to those that are new. The others' connections end when they close them: a restarted master does not know all at once."""
        subscription.publishers = publishers
        fresh = [self._new_link(route, subscription, uri) for uri in publishers - subscription.links.keys()]
        self._try(fresh)

    def _new_link(self, route: int, subscription: _Subscription, uri: str) -> _Link:
        link = _Link(route, subscription.topic, uri, next(self._tokens))
        subscription.links[uri] = link
        self._links[link.token] = link
        return link

    def _try(self, links: Iterable[_Link]) -> None:
        """Ask the nodes of these links where to connect to, each in another thread; those that are being asked are asked later."""
        by_node: dict[str, list[_Link]] = {}
        for link in links:
            if link.uri not in self._asked:
                by_node.setdefault(link.uri, []).append(link)
        for uri, of_node in by_node.items():
            if self._closed:
                return
            self._asked.add(uri)
            for link in of_node:
                link.under_way = True
            self._askers.submit(self._connect, uri, of_node)

    def _connect(self, uri: str, links: list[_Link]) -> None:
        try:
            away = ""
            for link in links:
                if away:
                    self._failed(link, away, refused=False)
                    continue
                try:
                    host, port = self.node.place_of(link.topic, link.uri)
                    addresses = resolve(host, port)
                except RefusedError as error:
                    self._failed(link, str(error), refused=False)
                except (OSError, ValueError, TypeError, LookupError) as error:  # it does not answer, or answers nonsense
                    away = str(error)
                    self._failed(link, away, refused=False)
                else:
                    self._connect_to(link, addresses[link.failures % len(addresses)], port)
        finally:
            with self._lock:
                self._asked.discard(uri)

    def _connect_to(self, link: _Link, address: str, port: int) -> None:
        with self._lock:
            wanted = link.route in self._subscriptions and link.token in self._links
            if wanted and not self._native.connect_publisher(link.route, link.token, address.encode(), port):
                self._failed(link, self._native.error().decode(errors="replace"), refused=False)

    def _failed(self, link: _Link, reason: str, *, refused: bool) -> None:
        """Try again later, unless the publisher is gone by the master's word, or another connection has taken its place."""
        with self._lock:
            subscription = self._subscriptions.get(link.route)
            if subscription is None or link.token not in self._links:
                return
            if refused and link.complaint != reason:
                link.complaint = reason
                logger.warning("%s: the publisher at %s is not bridged: %s", link.topic, link.uri, reason)
            link.connected = link.under_way = False
            if subscription.links.get(link.uri) is not link:
                del self._links[link.token]
                return
            if link.uri not in subscription.publishers:
                del subscription.links[link.uri]
                del self._links[link.token]
                return
            pause_s = REFUSED_RETRY_S if refused else min(FIRST_RETRY_S * 2**link.failures, LAST_RETRY_S)
            link.failures = min(link.failures + 1, 10)
            link.next_try_s = time.monotonic() + pause_s

    def on_event(self, kind: EventKind, token: int, text: str) -> None:
        """Handle an event of a connection."""
        with self._lock:
            link = self._links.get(token)
            if link is None:
                return
            if kind is EventKind.CONNECTED:
                link.connected, link.under_way, link.failures, link.complaint = True, False, 0, ""
            elif kind is EventKind.NEEDS_WRITER:
                self._native.add_writer(link.route, token)
            elif kind is EventKind.MISSED:
                self._replace(link)
            elif kind in {EventKind.CLOSED, EventKind.REFUSED}:
                self._failed(link, text, refused=kind is EventKind.REFUSED)
                if kind is EventKind.REFUSED:
                    self.on_refused(link.topic)

    def _replace(self, link: _Link) -> None:
        """Connect a second time to a publisher that is not heard any more, until that succeeds.

        Its system repeats what is not acknowledged at growing intervals: when the network is back after a long cut, a minute may go by. The
        data plane keeps the first connection until something comes on the second.
        """
        subscription = self._subscriptions[link.route]
        if subscription.links.get(link.uri) is link and link.uri in subscription.publishers:
            self._try([self._new_link(link.route, subscription, link.uri)])

    def try_again(self) -> bool:
        """Try the connections whose time has come; tell whether any is missing."""
        now_s = time.monotonic()
        with self._lock:
            missing = [link for link in self._links.values() if not link.connected]
            self._try(link for link in missing if not link.under_way and now_s >= link.next_try_s)
            return bool(missing)

    def close(self) -> None:
        """Connect to no further publisher."""
        self._closed = True
        self._askers.shutdown(wait=False, cancel_futures=True)
