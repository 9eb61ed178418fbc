"""A subscription that neither a message cut short on the wire nor a broken stream can end."""

from __future__ import annotations

import math
from collections.abc import Sequence
from threading import Event, Lock, Thread
from typing import Any

import rospy

from node_core.core import Input

SILENCE_S = 2.0  # that the rest of a message may take; mission clock: while it is held, or the machine is slow, none is due
LONGEST_SILENCE_S = 30.0
LOOK_S = 0.5  # wall clock


def warn_of_garbage(reason: str) -> None:
    """Log that a message is left out."""
    rospy.logwarn_throttle(2.0, f"left out: {reason}")


class Stream:
    """Detects, from the bytes that wait in a stream, whether it has lost the borders between its messages.

    It has where bytes have waited for the rest of their message for `SILENCE_S`, from the first look that sees it on: a look may fall
    between the bytes and their message, and the mission clock may have run far since the look before. Each time the timeout is doubled,
    until a message comes.
    """

    def __init__(self) -> None:
        self._messages = 0
        self._waits_since_s: float | None = None
        self._timeout_s = SILENCE_S

    def lost(self, waiting: int, messages: int, now_s: float) -> bool:
        """Return whether the connections are to be rebuilt.

        Args:
            waiting: bytes that wait for the rest of their message.
            messages: so many have come on the connections that are there now.
            now_s: mission clock.
        """
        if messages > self._messages:
            self._timeout_s = SILENCE_S
        if messages != self._messages or not waiting:
            self._messages, self._waits_since_s = messages, None
        if not waiting:
            return False
        if self._waits_since_s is None:
            self._waits_since_s = now_s
        if abs(now_s - self._waits_since_s) < self._timeout_s:  # absolute: the clock may go back
            return False
        self._messages, self._waits_since_s = 0, None
        self._timeout_s = min(2.0 * self._timeout_s, LONGEST_SILENCE_S)
        return True


class RawSubscriber:
    """Subscribe to bytes and decode them here.

    rospy decodes inside its receiving loop and keeps what can't be decoded at the head of its buffer: nothing after it is ever received.
    So the bytes are taken as they are, and what can't be decoded is told to ``garbage``, with a sentence. A `Stream` that has lost the
    borders between its messages can't be decoded at all: the connections are rebuilt, at growing intervals. Where no bytes wait, as mostly
    on a latched topic, nothing is wrong with the stream. Of messages that wait the newest ``queue_size`` are decoded.

    Nor does rospy hear of a publisher that is back as long as it keeps its old connection, for good if it gave that up. So when the last
    connection has ended, the topic is subscribed to anew.
    """

    def __init__(self, taken: Input) -> None:
        self._input = taken
        self._lock = Lock()
        self._stream = Stream()
        self._reconnected_s = -math.inf
        self._ended = Event()
        self._met = False
        self._subscriber: rospy.Subscriber | None = self._subscribe()
        self._watch = Thread(target=self._watch_connections, daemon=True)
        self._watch.start()

    def _subscribe(self) -> rospy.Subscriber:
        size, queue = self._input.buffer_bytes, self._input.queue_size
        return rospy.Subscriber(self._input.topic, rospy.AnyMsg, self._on_bytes, queue_size=queue, buff_size=size, tcp_nodelay=True)

    @property
    def published(self) -> bool:
        """Whether the topic has a publisher; one whose connection is being rebuilt counts."""
        connected = any(not each.done for each in self._connections)
        return connected or abs(rospy.get_time() - self._reconnected_s) < SILENCE_S

    @property
    def _connections(self) -> Sequence[Any]:
        """Rospy's connections, also those that it gave up as the publisher had gone meanwhile: it keeps them, and is done with them."""
        with self._lock:
            return () if self._subscriber is None else self._subscriber.impl.connections

    def close(self) -> None:
        """Unregister; no callback is called any more."""
        self._ended.set()
        self._unsubscribe()

    def _on_bytes(self, raw: rospy.AnyMsg) -> None:
        sent = raw._connection_header.get("type", "*")  # noqa: SLF001 -- rospy's documented way to the publisher's type
        self._input.take_bytes(sent, raw._buff)  # noqa: SLF001 -- all that an AnyMsg has

    def _watch_connections(self) -> None:
        pause = rospy.rostime.wallsleep
        while not (rospy.is_shutdown() or self._ended.is_set()):
            pause(LOOK_S)
            connections = self._connections
            buffers = [each.read_buff for each in connections]
            waiting = sum(buffer.tell() for buffer in buffers if buffer is not None)  # None: closed since
            if self._stream.lost(waiting, sum(each.stat_num_msg for each in connections), rospy.get_time()):
                self._reconnected_s = rospy.get_time()
                self._subscribe_anew()
            elif self._met and all(each.done for each in connections):
                self._subscribe_anew()
            else:
                self._met = bool(connections)

    def _subscribe_anew(self) -> None:
        """Without the lock: rospy waits here for a master that is away."""
        self._met = False
        self._unsubscribe()
        if self._ended.is_set():
            return
        subscriber = self._subscribe()
        with self._lock:
            self._subscriber = subscriber
        if self._ended.is_set():  # meanwhile
            self._unsubscribe()

    def _unsubscribe(self) -> None:
        with self._lock:
            subscriber, self._subscriber = self._subscriber, None
        if subscriber is not None:
            subscriber.unregister()
