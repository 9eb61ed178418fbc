"""One thread that handles datagrams, ticks of the mission clock and posted items as they come: both ends of the radio, and the radio."""

from __future__ import annotations

import os
import select
import socket
import threading
from collections import deque
from collections.abc import Callable, Sequence
from typing import Generic, TypeVar

import rospy
from rosgraph_msgs.msg import Clock

from resource_reporter import DoneReporter, ResourceReporter

NS = 1_000_000_000
LOOPBACK = "127.0.0.1"
WAIT_S = 0.1
BUFFER_BYTES = 1 << 20
LARGEST_DATAGRAM = 65535

Item = TypeVar("Item")
OnDatagram = Callable[[int, bytes], None]


def udp_socket(port: int) -> socket.socket:
    """Return a non-blocking socket that is bound to a port of loopback; 0: any."""
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    made.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER_BYTES)
    made.bind((LOOPBACK, port))
    made.setblocking(False)
    return made


class MissionLoop(Generic[Item]):
    """Calls ``on_datagram(which socket, data)``, ``on_item(item)`` and ``on_tick()``, one at a time, until ROS shuts down.

    ``now_ns`` is the mission clock: simulated where there is one, else the ROS clock at 50 Hz. After each tick ``~done`` tells its
    time, so that a simulator can wait for this loop and what the reporters tell. ``on_look()`` follows each turn of the loop, at least ten
    times a second of the monotonic clock, also where the mission clock creeps or stands.
    """

    def __init__(
        self,
        ports: Sequence[int],
        *,
        on_tick: Callable[[], None],
        on_datagram: OnDatagram | None = None,
        on_item: Callable[[Item], None] | None = None,
        on_look: Callable[[], None] | None = None,
        reporters: Sequence[ResourceReporter] = (),
    ) -> None:
        self.sockets = [udp_socket(port) for port in ports]
        self._on_tick, self._on_datagram, self._on_item = on_tick, on_datagram, on_item
        self._on_look = on_look
        self._items: deque[Item] = deque()
        self._now_ns = self._ticked_ns = 0
        self._wake = os.eventfd(0, os.EFD_NONBLOCK)
        self._lock = threading.Lock()
        self._reporters = reporters
        if rospy.get_param("/use_sim_time", False):
            self._source = rospy.Subscriber("/clock", Clock, self._on_clock, queue_size=100, tcp_nodelay=True)
        else:
            self._source = rospy.Timer(rospy.Duration.from_sec(0.02), self._on_timer)

    @property
    def now_ns(self) -> int:
        """Mission clock, nanoseconds."""
        return self._now_ns

    def post(self, item: Item) -> None:
        """Queue an item for the loop's thread; may be called from any."""
        with self._lock:
            self._items.append(item)
        os.eventfd_write(self._wake, 1)

    def send(self, data: bytes, port: int, *, by: int = 0) -> None:
        """Send a datagram to a port of loopback, whether a socket is bound there or not; answers come to the socket that it is sent by."""
        try:
            self.sockets[by].sendto(data, (LOOPBACK, port))
        except OSError as error:
            rospy.logwarn_throttle(5.0, f"a datagram to port {port} could not be sent: {error}")

    def run(self) -> None:
        """Handle packets, orders and ticks of the clock, one after another, until ROS shuts down."""
        self._done = DoneReporter(*self._reporters)
        while not rospy.is_shutdown():
            waiting: list[socket.socket | int] = [*self.sockets, self._wake]
            readable, _, _ = select.select(waiting, [], [], WAIT_S)
            if self._wake in readable:
                os.eventfd_read(self._wake)
            for number, each in enumerate(self.sockets):
                if each in readable:
                    self._receive(number, each)
            self._handle_items()
            self._tick()
            if self._on_look is not None:
                self._on_look()

    def _receive(self, number: int, source: socket.socket) -> None:
        while True:
            try:
                data = source.recv(LARGEST_DATAGRAM)
            except BlockingIOError:
                return
            except OSError:
                continue  # a datagram to a port without a socket comes back as an error here
            if self._on_datagram is not None:
                self._on_datagram(number, data)

    def _handle_items(self) -> None:
        while self._items:
            with self._lock:
                item = self._items.popleft()
            if self._on_item is not None:
                self._on_item(item)

    def _tick(self) -> None:
        now_ns = self._now_ns
        if now_ns <= self._ticked_ns:
            return
        self._ticked_ns = now_ns
        self._on_tick()
        self._done.done(now_ns)

    def _on_clock(self, message: Clock) -> None:
        self._now_ns = max(self._now_ns, message.clock.to_nsec())
        os.eventfd_write(self._wake, 1)

    def _on_timer(self, _event: object) -> None:
        self._now_ns = max(self._now_ns, rospy.Time.now().to_nsec())
        os.eventfd_write(self._wake, 1)
