"""Messages go out in the thread that publishes them, as long as their subscriber takes them: no other thread is woken for each."""

from __future__ import annotations

import select
import socket
from collections.abc import Collection

import rospy
from rospy.impl.tcpros_pubsub import QueuedConnection


class DirectConnection(QueuedConnection):  # type: ignore[misc]  # rospy has no types
    """A connection to a subscriber that hands its thread only what the socket does not take at once.

    rospy's own wakes a thread for each message and subscriber, and gives the processor up after each. The order of the messages, and
    that of those that wait the newest ``queue_size`` are sent, are the same; of a message that was begun the rest always is.
    """

    not_heard: frozenset[str] = frozenset()
    """Topics whose messages are not sent to the node itself."""
    _queue: list[bytes]
    _error: Exception | None

    def __init__(self, connection: rospy.impl.transport.Transport, queue_size: int) -> None:
        own = connection.endpoint_id == rospy.get_name()
        self._silent = own and connection.name in {rospy.resolve_name(topic) for topic in self.not_heard}
        self._writable = select.poll()
        self._writable.register(connection.socket, select.POLLOUT)
        self._rest = b""  # of a message of which the socket took a part
        self._relaying = False
        super().__init__(connection, queue_size)

    def write_data(self, data: bytes) -> bool:
        """Send a message, or queue it behind those before it; an error of the connection's thread is raised here."""
        if self._silent:
            return True
        with self._lock:
            if self._error:
                error, self._error = self._error, None
                raise error
            if not (self._relaying or self._rest or self._queue):
                self._rest = data[self._sent(data) :]
            else:
                if 0 < self._queue_size <= len(self._queue):
                    del self._queue[0]
                self._queue.append(data)
            if self._rest or self._queue:
                self._cond_data_available.notify()
        return True

    def _sent(self, data: bytes) -> int:
        """Return how many bytes the socket takes at once; what is wrong with it, the thread finds out."""
        to = self._connection
        if to.socket is None or to.done:
            return 0
        try:
            # rospy's sockets have a timeout, up to which Python waits for a full one, or none at all: MSG_DONTWAIT is not enough.
            sent: int = to.socket.send(data, socket.MSG_DONTWAIT) if self._writable.poll(0) else 0
        except OSError:
            return 0
        to.stat_bytes += sent
        to.stat_num_msg += sent == len(data)  # of others the thread sends the end
        return sent

    def _run(self) -> None:
        while not self._connection.done:
            with self._lock:
                self._relaying = False
                while not (self._rest or self._queue or self._connection.done):
                    self._cond_data_available.wait()
                waiting = [self._rest, *self._queue] if self._rest else self._queue
                self._rest, self._queue, self._relaying = b"", [], True
            for data in waiting:
                try:
                    self._connection.write_data(data)
                except Exception as error:  # noqa: BLE001 -- of whatever kind, for the one who publishes next
                    with self._lock:
                        self._error = error


def send_directly(*, not_heard: Collection[str] = ()) -> None:
    """Make all publishers of this process send directly, to all who subscribe from now on.

    ``not_heard``: topics that the node publishes and subscribes to for what others say there; to itself it sends nothing on them.
    """
    DirectConnection.not_heard = frozenset(not_heard)
    rospy.topics.QueuedConnection = DirectConnection
