"""Follow both worlds' graphs and keep the routes as `decisions` wants them: one thread.

ROS 2 tells when its graph changes, and the monitor of the master when ROS 1's does. A new route first offers its
target's end and begins to flow when the subscribers over there have connected to it (or after a second), so that the only message of
a short-lived publisher finds them.
"""

from __future__ import annotations

import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from typing import TYPE_CHECKING, cast

from ros_bridge import tcpros
from ros_bridge.checked_types import CheckedTypes
from ros_bridge.config import Direction, Spec, TopicRoute
from ros_bridge.decisions import Decision, Refused, RouteDecision, decide
from ros_bridge.graph import Graphs
from ros_bridge.graph_events import GraphEvents
from ros_bridge.hung_nodes import HungNodes
from ros_bridge.keep_alive import KeepAlive
from ros_bridge.ros1_graph import Ros1Reader
from ros_bridge.ros2_graph import read_ros2_graph
from ros_bridge.routes import key_of
from ros_bridge.service_types import ServiceTypes

if TYPE_CHECKING:
    from rclpy.node import Node

    from ros_bridge.conversion import Types
    from ros_bridge.master import Connection, MasterMonitor
    from ros_bridge.routes import RouteTable, TopicBridge
    from ros_bridge.selection import Selection

logger = logging.getLogger("ros_bridge")

LOOK_EVERY_S = 0.02  # while a route waits for its target's subscribers
IDLE_S = 0.2  # routes that are not wanted any more end after a while
CONNECT_WITHIN_S = 1.0
AGAIN_AFTER_S = 0.5
CALL_BACK_EVERY_S = 2.0


class GraphReader:
    """Reads both graphs and their types."""

    def __init__(self, node: Node, types: Types, master: Connection, caller_id: str, selection: Selection) -> None:
        self._node = node
        self._master = master
        self._caller_id = caller_id
        self._hung = HungNodes(time.monotonic)
        self.services = ServiceTypes(self._service_type, self._hung)
        self._selection = selection
        self._ros1 = Ros1Reader(master, caller_id, self.services, self._selects)
        self._service_sums: dict[str, str] = {}
        self.types = CheckedTypes(types, self._publisher_headers, self._service_sums)

    def read_ros1(self, system: bytes) -> bool:
        """Read ROS 1's graph from the master's answer to getSystemState; tell whether it has changed. Raises OSError."""
        return self._ros1.read(system)

    def graphs(self) -> Graphs:
        """Return ROS 1's graph as it was last read, and ROS 2's of now."""
        self.types.look_at(self._ros1.graph)
        return Graphs(self._ros1.graph, read_ros2_graph(self._node))

    def _selects(self, ros1_name: str) -> bool:
        ros2_name = self._selection.to_ros2(ros1_name)
        return ros2_name is not None and self._selection.selects(ros1_name, ros2_name)

    def _service_type(self, name: str) -> str | None:
        """Ask a service's node for its type, and note its sum."""
        try:
            uri = str(self._master.call("lookupService", self._caller_id, name))
        except OSError:
            return None
        header = tcpros.service_header(name, uri, self._caller_id)
        self._service_sums[name] = header.get("md5sum", "")
        return header.get("type")

    def _publisher_headers(self, topic: str) -> Iterator[dict[str, str]]:
        """Ask the publishers, but none that hangs."""
        for node in sorted(self._ros1.graph.publishers.get(topic, ())):
            if not self._hung.may_be_asked(node):
                continue
            try:
                uri = str(self._master.call("lookupNode", self._caller_id, node))
                header = tcpros.publisher_header(uri, topic, self._caller_id)
                self._hung.answers(node)
            except TimeoutError:
                self._hung.hangs(node)
                continue
            except OSError:
                continue
            if header is not None:
                yield header


class Discovery:
    """The thread. ``configured`` routes run always; discovery leaves their names alone."""

    def __init__(
        self, reader: GraphReader, node: Node, monitor: MasterMonitor, selection: Selection, table: RouteTable, configured: Iterable[Spec]
    ) -> None:
        self._reader = reader
        self._monitor = monitor
        self._selection = selection
        self._table = table
        self._configured = tuple(configured)
        self._events = GraphEvents(node)
        self._keep_alive = KeepAlive()
        self.connect_again: Callable[[str, str], None] = lambda *_: None  # asks a subscriber (topic, node) to
        self._turned_away: deque[dict[str, str]] = deque()  # connection headers of subscribers
        self._to_call_back: set[tuple[str, str]] = set()
        self._called_back_s: dict[tuple[str, str], float] = {}
        self._made_s: dict[Spec, float] = {}
        self._said: set[str] = set()
        self._losses = 0
        self._kept_after_loss: set[Spec] = set()
        self.decisions: list[Decision] = []
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="discovery", daemon=True)

    def start(self) -> None:
        """Start the thread that follows both graphs."""
        self._monitor.on_graph = self._reader.services.on_answer = self._events.wake
        self._thread.start()

    def doubt(self, topic: str) -> None:
        """Look again at a topic whose publisher in ROS 1 was refused because of its type. From any thread."""
        if not self._stop.is_set():
            self._reader.types.doubt(topic)
            self._events.wake()

    def hear(self, header: dict[str, str]) -> None:
        """Look again at a topic, a subscriber of which in ROS 1 was turned away because of its type. From any thread."""
        if not self._stop.is_set():
            self._reader.types.hear(header)
            self._turned_away.append(header)
            self._events.wake()

    def _run(self) -> None:
        while not self._stop.is_set():
            try:
                self._follow()
            except Exception:  # whatever a graph in motion makes rclpy or a node raise: bridging goes on, and the graph is read again
                if not self._stop.wait(AGAIN_AFTER_S):
                    logger.exception("discovery restarts after an error")

    def _follow(self) -> None:
        changed = True
        while not self._stop.is_set():
            turned_away = [self._turned_away.popleft() for _ in range(len(self._turned_away))]
            changed = self._read_ros1() or bool(turned_away) or changed
            if changed:
                self.decisions = decide(self._reader.graphs(), self._selection, self._reader.types, self._configured)
                self._report()
            waiting = self._apply(time.monotonic())
            self._call_back(turned_away, time.monotonic())
            changed = self._events.wait(LOOK_EVERY_S if waiting else IDLE_S)

    def _call_back(self, turned_away: Iterable[dict[str, str]], now_s: float) -> None:
        """Have subscribers connect again whose version their topics have now; not often, as they may be turned away again."""
        for fields in turned_away:
            if self._reader.types.has_version_of(fields):
                self._to_call_back.add((fields.get("topic", ""), fields.get("callerid", "")))
        self._called_back_s = {key: at_s for key, at_s in self._called_back_s.items() if now_s - at_s < CALL_BACK_EVERY_S}
        for key in self._to_call_back - self._called_back_s.keys():
            self._to_call_back.discard(key)
            self._called_back_s[key] = now_s
            self.connect_again(*key)

    def _read_ros1(self) -> bool:
        """Read ROS 1's graph. A restarted master knows less than before: routes that still have connections go on."""
        state = self._monitor.state
        if not state.reachable or not state.system:
            return False
        try:
            changed = self._reader.read_ros1(state.system)
        except OSError:
            return False
        if state.losses != self._losses:
            self._losses = state.losses
            self._kept_after_loss = set(self._table.running())
        return changed

    def _report(self) -> None:
        """Log once for each reason what can't be bridged."""
        for refused in self.decisions:
            if isinstance(refused, Refused) and refused.reason not in self._said:
                self._said.add(refused.reason)
                logger.warning("%s %s is not bridged: %s", refused.kind, refused.ros1_name, refused.reason)

    def _apply(self, now_s: float) -> bool:
        """Make, start, park and close routes; tell whether one waits for its target's subscribers."""
        wanted = self._keep_alive.update([one for one in self.decisions if isinstance(one, RouteDecision)], now_s)
        wanted += self._still_connected({one.spec for one in wanted})
        self._table.reconcile((*self._configured, *(one.spec for one in wanted)))
        running = self._table.running()
        self._made_s = {one.spec: self._made_s.get(one.spec, now_s) for one in wanted if one.spec in running}
        waiting = False
        for one in wanted:
            if one.spec in running:
                waiting = self._let_flow(one, now_s) or waiting
        return waiting

    def _let_flow(self, one: RouteDecision, now_s: float) -> bool:
        """Start a route whose subscribers have connected, park one that has none; tell whether it waits."""
        flows = self._table.started(one.spec)
        if not one.flows:
            if flows and not self._keeps_peers(one.spec):
                self._table.park(one.spec)
            self._made_s[one.spec] = now_s
            return False
        if flows:
            return False
        route = self._table.running()[one.spec]
        connected = not isinstance(one.spec, TopicRoute) or cast("TopicBridge", route).target_peers() >= one.receivers
        if connected or now_s - self._made_s[one.spec] >= CONNECT_WITHIN_S:
            self._table.start(one.spec)
            return False
        return True

    def _keeps_peers(self, spec: Spec) -> bool:
        """Return whether ROS 1 subscribers that a restarted master has forgotten are still connected."""
        route = self._table.running().get(spec) if spec in self._kept_after_loss and isinstance(spec, TopicRoute) else None
        return route is not None and cast("TopicBridge", route).target_peers() > 0

    def _still_connected(self, wanted: set[Spec]) -> list[RouteDecision]:
        """Return the routes that a restarted master has forgotten the peers of, while these are still connected."""
        running = self._table.running()
        superseded = {key_of(spec) for spec in wanted}
        kept = []
        for spec in [spec for spec in self._kept_after_loss if isinstance(spec, TopicRoute) and spec not in wanted]:
            route = cast("TopicBridge | None", running.get(spec))
            peers = 0 if route is None else route.source_peers() if spec.direction is Direction.ROS1_TO_ROS2 else route.target_peers()
            if peers and key_of(spec) not in superseded:
                kept.append(RouteDecision(spec, peers))
        self._kept_after_loss = {one.spec for one in kept} | (self._kept_after_loss & wanted)
        return kept

    def close(self) -> None:
        """Stop following; the routes are the table's."""
        self._monitor.on_graph = lambda: None
        self._reader.services.close()
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join(CONNECT_WITHIN_S)
        self._events.close()
