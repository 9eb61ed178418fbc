"""Decide which routes discovery wants, from the graphs of both worlds: a pure function, called at every change.

A topic goes to the other world when a node publishes it here; both ways when both worlds publish it. It flows only while a node
over there subscribes: before that it is offered, so that tools see it, and costs nothing. A service or an action goes from the world
that has its server, unless both have one.

Quality of service. Towards ROS 2 the bridge offers reliable and transient local, which suits every subscription there can be. From ROS 2
it asks for what all publishers of the topic offer: reliable if all are, transient local if all are.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, TypeVar

from ros_bridge.config import ActionRoute, Direction, Reliability, RosVersion, ServiceRoute, Spec, TopicRoute
from ros_bridge.errors import BridgeError
from ros_bridge.graph import ACTION_PARTS, Graphs, Ros2Endpoint
from ros_bridge.selection import Selection, is_ros2_name

if TYPE_CHECKING:
    from ros_bridge.checked_types import CheckedPair

DEPTH = 100
BULKY_DEPTH = 10  # of types with an array of bytes without an end: images, clouds, maps
MOST_OF_A_REASON = 500
NO_ROS2_NAME = "{1} can't be a name in ROS 2, where no part begins with a digit; give it another one (rename: {{{0}: /NAME}})"
Served = TypeVar("Served", ServiceRoute, ActionRoute)


class TypeLookup(Protocol):
    """What ``decide`` asks about types: both of a pair of which one may be unknown; raises BridgeError when they can't be converted."""

    def pair(self, ros1_type: str | None, ros2_type: str | None, topic: str) -> CheckedPair:
        """Return both types of a topic, by its name in ROS 1."""

    def service(self, ros1_type: str | None, ros2_type: str | None, service: str) -> CheckedPair:
        """Do the same for a service."""

    def action(self, ros1_type: str | None, ros2_type: str | None, action: str) -> CheckedPair:
        """Do the same for an action."""


@dataclass(frozen=True)
class RouteDecision:
    """A route that is to exist.

    ``receivers``: foreign subscribers of its target; with none nothing is forwarded. ``notes``: fields that were renamed or don't cross.
    """

    spec: Spec
    receivers: int = 0
    notes: tuple[str, ...] = ()

    @property
    def flows(self) -> bool:
        """Whether there are receivers; services and actions need none, their clients call."""
        return self.receivers > 0 or not isinstance(self.spec, TopicRoute)


@dataclass(frozen=True)
class Refused:
    """A selected name that can't be bridged, and the reason."""

    kind: str
    ros1_name: str
    ros2_name: str
    reason: str


Decision = RouteDecision | Refused


def decide(graphs: Graphs, selection: Selection, types: TypeLookup, configured: Iterable[Spec] = ()) -> list[Decision]:
    """Return a decision for each selected name: a route, or the reason why there is none. Names of configured routes are skipped.

    Whatever is raised about one name refuses this name and no other.
    """
    taken1 = {spec.ros1_name for spec in configured}
    taken2 = {spec.ros2_name for spec in configured}
    actions = _pairs(graphs.ros1.action_servers(), graphs.ros2.actions, selection)
    in_actions = {f"{ros1_name}/{part}" for ros1_name, _ in actions for part in ACTION_PARTS}
    names1 = graphs.ros1.publishers.keys() | graphs.ros1.subscribers.keys()
    names2 = graphs.ros2.publishers.keys() | graphs.ros2.subscribers.keys()
    topics = [pair for pair in _pairs(names1 - in_actions, names2, selection) if pair[0] not in in_actions]
    services = [pair for pair in _pairs(graphs.ros1.services, graphs.ros2.services, selection) if pair[0] not in graphs.ros1.services_asked]
    decisions: list[Decision] = []
    for kind, pairs, deciding in (("topic", topics, _topic), ("service", services, _service), ("action", actions, _action)):
        for ros1_name, ros2_name in sorted(pairs):
            if ros1_name in taken1 or ros2_name in taken2:
                continue
            try:
                found = list(deciding(graphs, types, ros1_name, ros2_name))
                if found and not is_ros2_name(ros2_name):
                    raise BridgeError(NO_ROS2_NAME.format(ros1_name, ros2_name))  # noqa: TRY301 - as any other refusal
                decisions += found
            except BridgeError as error:
                decisions.append(Refused(kind, ros1_name, ros2_name, _short(str(error))))
            except Exception as error:  # noqa: BLE001 - a node may say anything about its types
                decisions.append(Refused(kind, ros1_name, ros2_name, _short(f"{type(error).__name__}: {error}")))
    return decisions


def _short(reason: str) -> str:
    line = " ".join(reason.split())
    return line if len(line) <= MOST_OF_A_REASON else f"{line[:MOST_OF_A_REASON]} ..."


def _pairs(names1: Iterable[str], names2: Iterable[str], selection: Selection) -> dict[tuple[str, str], None]:
    """Return the selected pairs of names of which at least one exists."""
    pairs = [(name, selection.to_ros2(name)) for name in names1] + [(selection.to_ros1(name), name) for name in names2]
    return {(one, two): None for one, two in pairs if one is not None and two is not None and selection.selects(one, two)}


def _topic(graphs: Graphs, types: TypeLookup, ros1_name: str, ros2_name: str) -> Iterator[Decision]:
    publishers1 = graphs.ros1.publishers.get(ros1_name, frozenset())
    publishers2 = graphs.ros2.publishers.get(ros2_name, ())
    if not publishers1 and not publishers2:
        return
    subscribers1 = len(graphs.ros1.subscribers.get(ros1_name, ()))
    subscribers2 = graphs.ros2.subscribers.get(ros2_name, ())
    ros1_type = graphs.ros1.type_of(ros1_name)
    kinds2 = sorted({end.type_name for end in (publishers2 or subscribers2)})
    if ros1_type is None and not kinds2:
        return  # the type is not known yet
    if len(kinds2) > 1:
        raise BridgeError(f"ROS 2 has it with different types: {', '.join(kinds2)}")
    pair = types.pair(ros1_type, kinds2[0] if kinds2 else None, ros1_name)
    depth = BULKY_DEPTH if pair.bulky else DEPTH
    names = (ros1_name, ros2_name)
    if publishers1:
        receivers = sum(end.type_name == pair.ros2_type for end in subscribers2)
        depth_up = max(depth, len(publishers1))
        spec = TopicRoute(
            *names, Direction.ROS1_TO_ROS2, pair.ros1_type, latched=True, depth=depth_up, ros2_type=pair.ros2_type, md5sum=pair.md5sum
        )
        yield RouteDecision(spec, receivers, pair.notes)
    if publishers2:
        yield RouteDecision(_from_ros2(names, pair, depth, publishers2), subscribers1, pair.notes)


def _from_ros2(names: tuple[str, str], pair: CheckedPair, depth: int, publishers: tuple[Ros2Endpoint, ...]) -> TopicRoute:
    """Return the route with what all publishers offer: asking for more would leave some of them out."""
    reliable = all(end.reliable for end in publishers)
    return TopicRoute(
        *names,
        Direction.ROS2_TO_ROS1,
        pair.ros1_type,
        latched=all(end.transient_local for end in publishers),
        depth=max(depth, len(publishers)),
        reliability=Reliability.RELIABLE if reliable else Reliability.BEST_EFFORT,
        ros2_type=pair.ros2_type,
        md5sum=pair.md5sum,
    )


def _service(graphs: Graphs, types: TypeLookup, ros1_name: str, ros2_name: str) -> Iterator[Decision]:
    in1, in2 = ros1_name in graphs.ros1.services, ros2_name in graphs.ros2.services
    if in1 and in2:
        raise BridgeError("both worlds have a server")
    pair = types.service(graphs.ros1.service_types.get(ros1_name), graphs.ros2.services.get(ros2_name), ros1_name)
    yield RouteDecision(_served(ServiceRoute, ros1_name, ros2_name, pair, in_ros1=in1), notes=pair.notes)


def _action(graphs: Graphs, types: TypeLookup, ros1_name: str, ros2_name: str) -> Iterator[Decision]:
    in1, in2 = graphs.ros1.action_servers().get(ros1_name), graphs.ros2.actions.get(ros2_name)
    if in1 and in2:
        raise BridgeError("both worlds have a server")
    pair = types.action(in1, in2, ros1_name)
    yield RouteDecision(_served(ActionRoute, ros1_name, ros2_name, pair, in_ros1=in1 is not None), notes=pair.notes)


def _served(kind: type[Served], ros1_name: str, ros2_name: str, pair: CheckedPair, *, in_ros1: bool) -> Served:
    server = RosVersion.ROS1 if in_ros1 else RosVersion.ROS2
    return kind(ros1_name, ros2_name, server, pair.ros1_type, ros2_type=pair.ros2_type, md5sum=pair.md5sum)
