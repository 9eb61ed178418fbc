"""What the skills need of ROS 1, as the bridge's configuration has it: is it there, of the same type, and does it come often enough?"""

from __future__ import annotations

import select
import socket
import time
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from dataclasses import dataclass

from alula.common.deployments import Deployment, DeploymentError
from alula.common.robots import RobotFolder
from alula.language.errors import LanguageError
from alula.language.fleet import load_models
from alula.language.robot import Robot
from alula_flight.doctor.base import CALLER, Base, foreign
from alula_flight.doctor.findings import BINDINGS, Finding, listed, note, ok, problem
from alula_flight.station.parts import Places, bridge_file
from ros_bridge.action_types import action_type
from ros_bridge.config import ActionRoute, Direction, RosVersion, ServiceRoute, Spec, TopicRoute
from ros_bridge.config_file import load_config
from ros_bridge.conversion import Types
from ros_bridge.errors import BridgeError, WireError
from ros_bridge.graph import ANY_TYPE
from ros_bridge.master import call_node
from ros_bridge.session import make_types
from ros_bridge.tcpros import LENGTH, decode_header, encode_header, publisher_header, service_header

LISTEN_S, LISTEN_MOST_S, WITHIN_S = 3.0, 8.0, 2.0
"""How long topics are listened to: for a few periods of the slowest."""
PERIODS, SLOWER = 3, 1.25
"""So many periods are waited for; and a topic is slow from that part of its period on: the managers take its data for stale."""
CLOCK = "/clock"
REPORTED, STATES = "/reported", "/resource_states"
OURS = "skillset_interfaces"
STATES_TYPE = f"{OURS}/ResourceStates"


@dataclass
class Heard:
    """What has come on a topic of one publisher: how many messages, and when the first and the last one came (monotonic)."""

    messages: int = 0
    first_s: float = 0.0
    last_s: float = 0.0

    @property
    def period_s(self) -> float | None:
        """Return the mean time between messages; None for less than two."""
        return (self.last_s - self.first_s) / (self.messages - 1) if self.messages > 1 else None


def look_at_bindings(deployment: Deployment, places: Places, robot: RobotFolder, base: Base, reached: frozenset[str]) -> Iterator[Finding]:
    """Yield what is to be said of the topics, services and actions that the bridge carries; ``reached``: the nodes that can be."""
    if not deployment.bridge:
        yield note(BINDINGS, "not looked at: the bridge runs elsewhere (the deployment has no `bridge`)")
        return
    try:
        config = load_config([bridge_file(deployment, places)], namespace=deployment.namespace)
    except (BridgeError, DeploymentError) as error:
        yield problem(BINDINGS, str(error), "alula setup makes the bridge's configuration again from skillsets/bindings.yaml")
        return
    types = make_types(config)
    models = _models(robot)
    look = _Look(base, reached, types, _periods(models))
    routes = [route for route in config.routes if not _is_heartbeat_of_a_reporter(route)]
    with ThreadPoolExecutor(max(1, len(routes))) as pool:  # all topics are listened to at the same time
        found = [one for every in pool.map(look.route, routes) for one in every]
    for skillset in models.skillsets if models is not None else ():
        found += look.reporters(skillset.name, needed=any(resource.silence_s is not None for resource in skillset.resources))
    yield from found
    bad = len({one.what.partition(":")[0] for one in found})
    yield ok(BINDINGS, f"{len(config.routes) - bad} of {len(config.routes)} topics, services and actions are as the bridge needs them")


def _models(robot: RobotFolder) -> Robot | None:
    try:
        return load_models(robot)
    except LanguageError:
        return None  # `alula check` is the one that tells


def _periods(models: Robot | None) -> dict[str, tuple[str, float]]:
    """Return by each topic which data comes from it, and its period in seconds where the model gives one."""
    return {
        models.source(skillset, data).topic: (f"{skillset.name}.{data.name}", data.period_s)
        for skillset in (models.skillsets if models is not None else ())
        for data in skillset.data
        if models is not None and data.period_s is not None
    }


def _is_heartbeat_of_a_reporter(route: Spec) -> bool:
    return isinstance(route, TopicRoute) and route.ros1_name.endswith(REPORTED) and route.type_name == STATES_TYPE


class _Look:
    """Looks at one route after the other; safe from several threads."""

    def __init__(self, base: Base, reached: frozenset[str], types: Types, periods: Mapping[str, tuple[str, float]]) -> None:
        self._base = base
        self._reached = reached
        self._types = types
        self._periods = periods
        slowest_s = max((period_s for _, period_s in periods.values()), default=0.0)
        self._listen_s = min(max(LISTEN_S, PERIODS * slowest_s), LISTEN_MOST_S)

    def route(self, route: Spec) -> list[Finding]:
        """Return what is wrong with a route."""
        try:
            if isinstance(route, TopicRoute):
                return list(self._from_ros1(route) if route.direction is Direction.ROS1_TO_ROS2 else self._to_ros1(route))
            if route.server is RosVersion.ROS2:
                return []  # it is the managers': they are looked at in ROS 2
            return list(self._service(route) if isinstance(route, ServiceRoute) else self._action(route))
        except BridgeError as error:
            return [
                problem(
                    BINDINGS, f"{route.ros1_name}: {error}", "have its package here, too: `ros1: packages` of robot.yaml; then alula setup"
                )
            ]
        except OSError as error:
            return [problem(BINDINGS, f"{route.ros1_name}: its node does not answer: {error}", "restart that node")]

    # --- topics -------------------------------------------------------------------------------------------------------

    def _from_ros1(self, route: TopicRoute) -> Iterator[Finding]:
        topic = route.ros1_name
        data, period_s = self._periods.get(topic, ("", None))
        publishers = foreign(self._base.publishers.get(topic, frozenset()), bridges=False)
        if not publishers:
            if topic != CLOCK:  # only a simulator has it
                yield self._nobody(route, data)
            return
        yield from self._type(route, publishers)
        expected = self._types.message(route.type_name, route.ros2_type).md5sum
        for node in sorted(publishers & self._reached):
            uri = self._base.uris[node]
            header = publisher_header(uri, topic, CALLER)
            if header is None:
                yield problem(BINDINGS, f"{topic}: {node} does not give it to us", f"restart {node}")
            elif header.get("md5sum", expected) != expected and header.get("type") == route.type_name:
                yield self._other_sum(topic, node, route.type_name, header["md5sum"], expected)
            else:
                heard = listen(uri, topic, self._listen_s)
                yield from self._often(topic, node, data, period_s, heard, latched=header.get("latching") == "1")

    def _nobody(self, route: TopicRoute, data: str) -> Finding:
        topic = route.ros1_name
        near = [name for name in self._base.publishers if name.rpartition("/")[2] == topic.rpartition("/")[2]]
        hint = f"is it {listed(near)}?" if near else "start its node"
        return problem(
            BINDINGS,
            f"{topic}: no node in ROS 1 publishes it{f' (data {data})' if data else ''}",
            f"{hint}, or correct the name in skillsets/bindings.yaml",
        )

    def _often(self, topic: str, node: str, data: str, period_s: float | None, heard: Heard, *, latched: bool) -> Iterator[Finding]:
        if not heard.messages:
            what = f"{topic}: {node} has sent nothing within {self._listen_s:g} s"
            if period_s is not None:
                yield problem(BINDINGS, f"{what}, and data {data} is to come every {period_s:g} s", f"does the sensor of {node} work?")
            elif not latched:
                yield note(BINDINGS, what)
        elif period_s is not None:
            taken_s = heard.period_s if heard.period_s is not None else self._listen_s
            if taken_s > SLOWER * period_s:
                often = f"sends it every {taken_s:.1f} s" if heard.period_s is not None else f"has sent it once within {taken_s:g} s"
                what = f"{topic}: {node} {often}, and data {data} is to come every {period_s:g} s: it would be stale"
                yield problem(BINDINGS, what, "have it sent more often, or give the data a longer `period` in the model")

    def _to_ros1(self, route: TopicRoute) -> Iterator[Finding]:
        topic = route.ros1_name
        subscribers = foreign(self._base.subscribers.get(topic, frozenset()), bridges=False)
        if not subscribers:
            if not _may_be_unheard(topic):
                yield problem(
                    BINDINGS,
                    f"{topic}: no node in ROS 1 subscribes to it",
                    "start its node, or correct the name in skillsets/bindings.yaml",
                )
            return
        yield from self._type(route, subscribers)

    def _type(self, route: TopicRoute, nodes: frozenset[str]) -> Iterator[Finding]:
        kind = self._base.types.get(route.ros1_name, ANY_TYPE)
        if kind not in {ANY_TYPE, route.type_name}:
            yield problem(
                BINDINGS,
                f"{route.ros1_name}: it is {kind} in ROS 1 ({listed(nodes)}), and {route.type_name} in the bridge's configuration",
                "correct the type in skillsets/bindings.yaml or types.yaml, then alula setup",
            )

    @staticmethod
    def _other_sum(name: str, node: str, kind: str, theirs: str, ours: str) -> Finding:
        package = kind.partition("/")[0]
        copied = (
            f"copy {package}{' and resource_reporter' if package == OURS else ''} of this checkout to the base's computer, and build there"
        )
        return problem(
            BINDINGS,
            f"{name}: {node} has another version of {kind} (MD5 {theirs[:8]}, here {ours[:8]})",
            copied if package == OURS else f"have {package} in the same version on both computers",
        )

    # --- reporters ----------------------------------------------------------------------------------------------------

    def reporters(self, skillset: str, *, needed: bool) -> Iterator[Finding]:
        """Yield what is to be said of the base's nodes that report states of a skillset's resources: their version, and their heartbeat.

        ``needed``: a resource of it has a `silence`, after which nothing is known of it.
        """
        topic = f"/{skillset}{REPORTED}"
        told = foreign(self._base.publishers.get(topic, frozenset()), bridges=False) & self._reached
        listening = foreign(self._base.subscribers.get(f"/{skillset}{STATES}", frozenset()), bridges=False) & self._reached
        copied = "copy resource_reporter and skillset_interfaces of this checkout to the base's computer, and build there"
        expected = self._types.message(STATES_TYPE).md5sum
        for node in sorted(told):
            try:
                header = publisher_header(self._base.uris[node], topic, CALLER)
            except TimeoutError:
                yield problem(BINDINGS, f"{topic}: {node} does not answer", f"restart {node}")
                continue
            if header is not None and header.get("md5sum", expected) != expected:
                yield problem(BINDINGS, f"{topic}: the ResourceReporter of {node} is of another version", copied)
        if needed and not told:
            what = f"{topic}: no reporter says that it lives, so resources with a `silence` become unknown"
            older = f"the package resource_reporter of {listed(listening)} is an older one: {copied}"
            yield problem(BINDINGS, what, older if listening else "start the node that has the ResourceReporter")
        elif listening - told:
            what = f"{topic}: {listed(listening - told)} follows the states of {skillset}, and reports nothing"
            yield note(BINDINGS, what, f"if it has a ResourceReporter, that is an older one: {copied}")

    # --- services and actions -----------------------------------------------------------------------------------------

    def _service(self, route: ServiceRoute) -> Iterator[Finding]:
        name = route.ros1_name
        node = self._base.services.get(name)
        if node is None or not foreign([node], bridges=False):
            near = [one for one in self._base.services if one.rpartition("/")[2] == name.rpartition("/")[2]]
            yield problem(BINDINGS, f"{name}: no node in ROS 1 serves it", f"is it {listed(near)}?" if near else "start its node")
            return
        if node not in self._reached:
            return
        uri = str(call_node(self._base.master, "lookupService", CALLER, name, within_s=WITHIN_S))
        header = service_header(name, uri, CALLER)
        expected = self._types.service(route.type_name, route.ros2_type).md5sum
        if not header:
            yield problem(BINDINGS, f"{name}: {node} does not answer at {uri}", f"restart {node}")
        elif header.get("type", route.type_name) != route.type_name:
            what = f"{name}: it is {header['type']} in ROS 1 ({node}), and {route.type_name} in the bridge's configuration"
            yield problem(BINDINGS, what, "correct the type in skillsets/bindings.yaml, then alula setup")
        elif header.get("md5sum", expected) != expected:
            yield self._other_sum(name, node, route.type_name, header["md5sum"], expected)

    def _action(self, route: ActionRoute) -> Iterator[Finding]:
        name = route.ros1_name
        servers = self._base.subscribers.get(f"{name}/goal", frozenset()) & self._base.publishers.get(f"{name}/status", frozenset())
        servers = foreign(servers, bridges=False)
        if not servers:
            yield problem(BINDINGS, f"{name}: no action server in ROS 1", "start its node, or correct the name in skillsets/bindings.yaml")
            return
        wanted = f"{route.type_name}ActionGoal"
        kind = self._base.types.get(f"{name}/goal", ANY_TYPE)
        if kind not in {ANY_TYPE, wanted}:
            what = f"{name}: it takes {kind} in ROS 1 ({listed(servers)}), and {wanted} in the bridge's configuration"
            yield problem(BINDINGS, what, "correct the type in skillsets/bindings.yaml, then alula setup")
            return
        parts = action_type(self._types, route.type_name, route.ros2_type or self._types.rules.to_ros2(route.type_name))
        for node in sorted(servers & self._reached):
            header = publisher_header(self._base.uris[node], f"{name}/result", CALLER)
            ours = parts.result.envelope.md5sum
            if header is not None and header.get("md5sum", ours) != ours:
                yield self._other_sum(name, node, route.type_name, header["md5sum"], ours)


def _may_be_unheard(topic: str) -> bool:
    """Return whether a topic of ours is there for whoever wants it: the managers' states and heartbeats, and those of a mission."""
    return topic.endswith((STATES, "/alive")) or topic == "/mission/heartbeat"


def listen(node_uri: str, topic: str, for_s: float) -> Heard:
    """Count a publisher's messages for so long; what can't be connected has sent none."""
    heard, end_s = Heard(), time.monotonic() + for_s
    wanted = {"topic": topic, "type": ANY_TYPE, "md5sum": ANY_TYPE, "callerid": CALLER, "message_definition": ""}
    try:
        _, host, port = call_node(node_uri, "requestTopic", CALLER, topic, [["TCPROS"]], within_s=WITHIN_S)
        with closing(socket.create_connection((str(host), int(port)), timeout=WITHIN_S)) as connection:
            connection.sendall(encode_header(wanted))
            decode_header(_read(connection, LENGTH.unpack(_read(connection, LENGTH.size))[0]))
            while (left_s := end_s - time.monotonic()) > 0.0 and select.select([connection], [], [], left_s)[0]:
                _skip(connection, LENGTH.unpack(_read(connection, LENGTH.size))[0])
                heard.last_s = time.monotonic()
                heard.first_s = heard.first_s or heard.last_s
                heard.messages += 1
    except (OSError, ValueError, TypeError, WireError):
        pass  # whether it can be reached is told elsewhere; what had come until then counts
    return heard


def _read(connection: socket.socket, size: int) -> bytes:
    data = bytearray()
    while len(data) < size:
        part = connection.recv(size - len(data))
        if not part:
            raise WireError("the connection was closed")
        data += part
    return bytes(data)


def _skip(connection: socket.socket, size: int) -> None:
    while size > 0:
        part = len(connection.recv(min(size, 1 << 16)))
        if not part:
            raise WireError("the connection was closed")
        size -= part
