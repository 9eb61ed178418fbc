"""Subscribers in ROS 1 that have lost their connection to the bridge are asked to connect again, as long as the master names them.

A subscriber connects when the master tells it of a publisher, and only then: rospy and roscpp do not come back, or late, after their own
end of a connection is gone. So the bridge tells it the topic's publishers as the master would (``publisherUpdate``), once without
itself, at which roscpp gives up what it has of the bridge, and once with itself.

Before, it ends what the subscriber may still take for a connection, although the bridge's end is gone (half open): it asks for a second
connection between the same two ports. The subscriber's system answers that with the number it expects next, and ours, which knows no
such connection, resets it (RFC 793, "Half-Open Connection Discovery").

A subscriber that answers under its name although nothing is heard on its connection has another address than before. rospy keeps the old
connection for two minutes, and makes no second one to the same URI; so it is told this node's URI in another form, with more slashes at
its end.
"""

from __future__ import annotations

import errno
import logging
import socket
import threading
import time
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from ros_bridge.errors import WireError
from ros_bridge.master import Connection, RefusedError, call_node
from ros_bridge.native import EventKind, Native
from ros_bridge.tcpros import decode_header

if TYPE_CHECKING:
    from ros_bridge.ros1_node import Ros1Node

logger = logging.getLogger("ros_bridge")

MASTER_NAME = "/master"
ASKING_THREADS = 16
ANSWER_WITHIN_S = 1.0
HALF_OPEN_WITHIN_S = 1.5  # the reset makes the system ask a second time, after a second
NOT_FREE = {errno.EADDRINUSE, errno.EADDRNOTAVAIL}  # what was lost here is still being ended
MOVED_AFTER_S = 1.3  # a connection that comes back is heard within a second and a quarter
FIRST_TRY_S = 0.3  # roscpp comes back by itself within 0.1 s where it can
UNREACHED_RETRY_S, FIRST_RETRY_S, LAST_RETRY_S = 0.3, 1.0, 5.0


@dataclass(frozen=True)
class _Ends:
    """Of a connection that was lost: the address here, the subscriber's, and its port."""

    here: str
    there: str
    port: int


@dataclass
class _Lost:
    """A subscriber's node: its topics that have no connection, and those whose connection is silent; since when the node answers."""

    topics: set[str] = field(default_factory=set)
    unheard: set[str] = field(default_factory=set)
    reached_s: float | None = None
    ends: dict[str, _Ends] = field(default_factory=dict)
    next_try_s: float = 0.0
    tries: int = 0
    under_way: bool = False


class SubscriberLinks:
    """Connections of subscribers to the bridge's topics. Safe from several threads; ``node`` has to be set before the first event."""

    node: Ros1Node

    def __init__(self, master: Connection, library: Native, context: int) -> None:
        """Know no subscriber yet; ``context`` is the data plane's, which they connect to."""
        self._master = master
        self._native = library
        self._context = context
        self._port = int(library.port(context))
        self._forms: Counter[tuple[str, str]] = Counter()  # of this node's URI that a topic's subscriber was told
        self._lock = threading.Lock()
        self._connections: Counter[tuple[str, str]] = Counter()  # by topic and node; a node may have several for a moment
        self._lost: dict[str, _Lost] = {}  # by node
        self.on_turned_away: Callable[[dict[str, str]], None] = lambda _: None  # its header: it has another type, or version of it
        self._closed = False
        self._askers = ThreadPoolExecutor(ASKING_THREADS, thread_name_prefix="plane_call")

    def on_event(self, kind: EventKind, text: str) -> None:
        """Take what has become of a subscriber's connection; ``text`` is the topic, the node's name, and the ends of what has ended."""
        topic, name, *ends = text.split(" ")
        with self._lock:
            lost = self._lost.setdefault(name, _Lost())
            if kind is EventKind.SUBSCRIBED:
                self._connections[topic, name] += 1
                lost.topics.discard(topic)
                if self._connections[topic, name] > 1 and (topic, name) in self._forms:
                    self._native.end_older_connections(self._context, f"{topic} {name}".encode())
            elif kind is EventKind.UNSUBSCRIBED:
                self._connections[topic, name] -= 1
                if self._connections[topic, name] <= 0:
                    self._lose(lost, topic, name, ends)
            elif kind is EventKind.UNHEARD:
                lost.unheard.add(topic)
            if kind is not EventKind.UNHEARD:
                lost.unheard.discard(topic)
            if not lost.unheard:
                lost.reached_s = None
            self._forget_if_well(name, lost)

    def on_header(self, kind: EventKind, content: bytes) -> None:
        """Take the connection header of a subscriber that was turned away."""
        try:
            header = decode_header(content)
        except WireError:
            return
        topic, name = header.get("topic", ""), header.get("callerid", "")
        if kind is EventKind.NOT_PUBLISHED:  # perhaps for a moment, while the topic's route is made again
            self.connect_again(topic, name, after_s=FIRST_TRY_S)
            return
        with self._lock:
            lost = self._lost.get(name)
            if lost is not None:
                lost.topics.discard(topic)
                self._forget_if_well(name, lost)
        self.on_turned_away(header)

    def connect_again(self, topic: str, name: str, *, after_s: float = 0.0) -> None:
        """Have a subscriber that was turned away connect again.

        rospy keeps the connection that was refused, and makes no second one to the same URI: it is told another form of it.
        """
        with self._lock:
            self._forms[topic, name] += 1
            lost = self._lost.setdefault(name, _Lost())
            lost.topics.add(topic)
            lost.next_try_s, lost.tries = time.monotonic() + after_s, 0

    def _lose(self, lost: _Lost, topic: str, name: str, ends: list[str]) -> None:
        del self._connections[topic, name]
        if not lost.topics:
            lost.next_try_s, lost.tries = time.monotonic() + FIRST_TRY_S, 0
        lost.topics.add(topic)
        if ends:
            lost.ends[topic] = _Ends(ends[0], ends[1], int(ends[2]))

    def _forget_if_well(self, name: str, lost: _Lost) -> None:
        if not lost.topics and not lost.unheard:
            self._lost.pop(name, None)

    def try_again(self) -> bool:
        """Ask the nodes whose time has come; tell whether any is missing."""
        now_s = time.monotonic()
        with self._lock:
            for name, lost in self._lost.items():
                if not lost.under_way and now_s >= lost.next_try_s and not self._closed:
                    lost.under_way = True
                    self._askers.submit(self._ask, name, lost)
            return bool(self._lost)

    def _ask(self, name: str, lost: _Lost) -> None:
        """Have one node connect again; forget the topics that it does not subscribe to any more, or that are not published here."""
        reached = False
        try:
            for topic in self._topics(lost.topics):
                if not self._still_wanted(topic, name):
                    self._forget(name, lost, topic)
                elif topic in self._topics(lost.topics):
                    self._end_half_open(lost.ends.get(topic))
                    self._tell_publishers(topic, self._uri_of(name), self.node.uri + "/" * self._forms[topic, name])
            if self._topics(lost.unheard):
                self._look_after_unheard(name, lost)
            reached = True
        except (OSError, ValueError, TypeError) as error:  # it does not answer, or answers nonsense
            # One that says no has just gone, and so has the process behind a port that is closed.
            reached = isinstance(error, RefusedError) or isinstance(error.__cause__, ConnectionRefusedError)
            logger.debug("%s can't be asked to connect again: %s", name, error)
        with self._lock:
            pause_s = min(FIRST_RETRY_S * 2**lost.tries, LAST_RETRY_S) if reached and lost.topics else UNREACHED_RETRY_S
            lost.tries = min(lost.tries + reached, 10)
            lost.next_try_s = time.monotonic() + pause_s
            lost.under_way = False

    def _look_after_unheard(self, name: str, lost: _Lost) -> None:
        """Have a node that answers connect anew where its connections stay silent for longer than those that come back do."""
        uri = self._uri_of(name)
        call_node(uri, "getPid", self.node.name, within_s=ANSWER_WITHIN_S)
        now_s = time.monotonic()
        with self._lock:
            if lost.reached_s is None:
                lost.reached_s = now_s
            if now_s - lost.reached_s < MOVED_AFTER_S:
                return
            lost.reached_s = None
            self._forms.update((topic, name) for topic in lost.unheard)
        for topic in self._topics(lost.unheard):
            if self._still_wanted(topic, name):
                self._tell_publishers(topic, uri, self.node.uri + "/" * self._forms[topic, name])
            else:
                self._forget(name, lost, topic)

    def _uri_of(self, name: str) -> str:
        return str(self._master.call("lookupNode", self.node.name, name))

    def _topics(self, topics: set[str]) -> list[str]:
        with self._lock:
            return sorted(topics)

    def _still_wanted(self, topic: str, name: str) -> bool:
        _, subscribers, _ = self._master.call("getSystemState", self.node.name)
        return self.node.offers(topic) is not None and name in dict(subscribers).get(topic, ())

    def _forget(self, name: str, lost: _Lost, topic: str) -> None:
        with self._lock:
            lost.topics.discard(topic)
            lost.unheard.discard(topic)
            self._forget_if_well(name, lost)

    def _end_half_open(self, ends: _Ends | None) -> None:
        """End what the subscriber has of a lost connection. Raises OSError when its computer does not answer."""
        if ends is None:
            return
        family = socket.AF_INET6 if ":" in ends.there else socket.AF_INET
        with socket.socket(family, socket.SOCK_STREAM) as asking:
            asking.settimeout(HALF_OPEN_WITHIN_S)
            asking.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEPORT, 1)
            try:
                asking.bind((ends.here, self._port))
                asking.connect((ends.there, ends.port))
            except ConnectionRefusedError:
                pass  # there is no such connection, or not any more
            except OSError as error:
                if error.errno not in NOT_FREE:
                    raise

    def _tell_publishers(self, topic: str, uri: str, own_uri: str) -> None:
        """Tell a subscriber who publishes; again when that has changed meanwhile, as the master's own word may have come in between."""
        others = self._other_publishers(topic)
        self._update(uri, topic, others)
        while True:
            self._update(uri, topic, [*others, own_uri])
            now = self._other_publishers(topic)
            if now == others:
                return
            others = now

    def _other_publishers(self, topic: str) -> list[str]:
        publishers, _, _ = self._master.call("getSystemState", self.node.name)
        uris = [self._uri_of(name) for name in dict(publishers).get(topic, [])]
        return [uri for uri in uris if uri != self.node.uri]

    @staticmethod
    def _update(uri: str, topic: str, publishers: list[str]) -> None:
        call_node(uri, "publisherUpdate", MASTER_NAME, topic, publishers, within_s=ANSWER_WITHIN_S)

    def close(self) -> None:
        """Ask no further node."""
        self._closed = True
        self._askers.shutdown(wait=False, cancel_futures=True)
