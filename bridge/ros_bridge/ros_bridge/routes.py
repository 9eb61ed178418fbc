"""Routes as the node sees them: made from a spec by their kind's maker, started, read, closed; and the table of those that run.

A kind of route (topic, service, action) is a frozen spec in ``config`` and a maker: ``make(spec, context) -> Route``. A spec is its
route's identity: when anything in it changes, the old route is closed and another one made.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

from ros_bridge.config import TopicRoute
from ros_bridge.errors import BridgeError
from ros_bridge.stats import Figures

if TYPE_CHECKING:
    from rclpy.node import Node

    from ros_bridge.config import Spec
    from ros_bridge.conversion import Types
    from ros_bridge.plane import Plane

logger = logging.getLogger("ros_bridge")


class Route(Protocol):
    """A route of one topic, service or action; its kind's maker makes it, or raises BridgeError."""

    def start(self) -> None:
        """Open the end that messages or calls come from; the maker has opened the other, so that its peers can connect first."""

    def figures(self) -> Figures:
        """Return what has crossed so far; cheap, from any thread, also after ``close``."""

    def close(self) -> None:
        """Close both ends; nothing crosses any more when it returns."""


class TopicBridge(Route, Protocol):
    """A topic's route, which also counts its peers."""

    def target_peers(self) -> int:
        """Return how many subscribers are connected to the end that messages go out of."""

    def source_peers(self) -> int:
        """Return how many publishers are connected to the end that messages come from; 0 before ``start``."""


@dataclass(frozen=True)
class Context:
    """The parts of the bridge that a maker uses."""

    node: Node
    types: Types
    plane: Plane


class Maker(Protocol):
    """Make a route: the ends that offer are open when it returns, nothing flows before ``start``."""

    def __call__(self, spec: Any, context: Context, /) -> Route:
        """Return the route; raises BridgeError."""


Key = tuple[str, str, str, str]


def key_of(spec: Spec) -> Key:
    """Return the key of a route that outlasts changes of its quality of service and type: kind, direction and names."""
    way = spec.direction if isinstance(spec, TopicRoute) else spec.server
    return type(spec).__name__, way.value, spec.ros1_name, spec.ros2_name


class RouteTable:
    """The routes that run, kept equal to the wanted ones; safe to read and change from several threads."""

    def __init__(self, makers: Mapping[type, Maker], context: Context) -> None:
        """Begin with none; ``makers`` has the maker of each kind of spec."""
        self._makers = makers
        self._context = context
        self._lock = threading.RLock()
        self._running: dict[Spec, Route] = {}
        self._started: set[Spec] = set()
        self._earlier: dict[Key, Figures] = {}
        self.failed: dict[Spec, str] = {}

    def reconcile(self, wanted: Iterable[Spec]) -> None:
        """Close what is not wanted and make what is missing; a spec that fails is reported once, and tried when wanted again."""
        wanted = dict.fromkeys(wanted)
        with self._lock:
            for spec in [spec for spec in self._running if spec not in wanted]:
                self._close(spec)
            self.failed = {spec: reason for spec, reason in self.failed.items() if spec in wanted}
            for spec in wanted:
                if spec not in self._running and spec not in self.failed:
                    self._make(spec)

    def start(self, spec: Spec) -> None:
        """Let a route flow, once."""
        with self._lock:
            if spec in self._running and spec not in self._started:
                try:
                    self._running[spec].start()
                    self._started.add(spec)
                except Exception as error:  # noqa: BLE001 - of one route; the others go on
                    self._close(spec)
                    self._give_up(spec, error)

    def started(self, spec: Spec) -> bool:
        """Return whether a route forwards messages."""
        with self._lock:
            return spec in self._started

    def park(self, spec: Spec) -> None:
        """Make a route again whose target is advertised while nothing is forwarded, because there was no receiver."""
        with self._lock:
            self._close(spec)
            self._make(spec)

    def _make(self, spec: Spec) -> None:
        try:
            self._running[spec] = self._maker(spec)(spec, self._context)
        except Exception as error:  # noqa: BLE001 - whatever its type or rclpy raise; the others go on
            self._give_up(spec, error)

    def _give_up(self, spec: Spec, error: Exception) -> None:
        self.failed[spec] = str(error) if isinstance(error, BridgeError) else f"{type(error).__name__}: {error}"
        logger.error("%s is not bridged: %s", spec.label, self.failed[spec])

    def _maker(self, spec: Spec) -> Maker:
        if type(spec) not in self._makers:
            raise BridgeError(f"{spec.label}: this bridge has no maker for a {type(spec).__name__}")
        return self._makers[type(spec)]

    def _close(self, spec: Spec) -> None:
        route = self._running.pop(spec)
        self._started.discard(spec)
        try:
            route.close()
        except Exception:  # of one route; the others go on
            logger.exception("%s does not close", spec.label)
        self._earlier[key_of(spec)] = route.figures().after(self._earlier.get(key_of(spec), Figures()))

    def running(self) -> dict[Spec, Route]:
        """Return the running routes by their specs, in the order in which they were made."""
        with self._lock:
            return dict(self._running)

    def figures(self) -> dict[Spec, Figures]:
        """Return the figures of the running routes, with what crossed before they were made again."""
        return {spec: route.figures().after(self._earlier.get(key_of(spec), Figures())) for spec, route in self.running().items()}

    def close(self) -> None:
        """Close all routes, also those that failed."""
        self.reconcile(())
