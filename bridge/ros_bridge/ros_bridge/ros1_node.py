"""The bridge's node in ROS 1: it registers what it publishes, subscribes to and serves with the master, and answers other nodes' questions.

It speaks the master and slave APIs (ROS wiki, "ROS/Master_API", "ROS/Slave_API"); messages and calls go through the data plane.
"""

from __future__ import annotations

import logging
import os
import socket
import threading
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from socketserver import ThreadingMixIn
from typing import Any
from xmlrpc.server import SimpleXMLRPCRequestHandler, SimpleXMLRPCServer

from ros_bridge.addresses import bind_address, in_uri
from ros_bridge.master import OK, Connection, RefusedError, call_node

logger = logging.getLogger("ros_bridge")

NODE_NAME = "ros_bridge"
ANSWER_WITHIN_S = 1.5
FAILED = 0
PublishersChanged = Callable[[str, list[str]], None]


def own_name(arguments: list[str]) -> str:
    """Return the node's full name: ``ros_bridge``, or what roslaunch says by ``__name:=`` and ``__ns:=`` (or ROS_NAMESPACE)."""
    told = dict(argument.split(":=", 1) for argument in arguments if ":=" in argument)
    namespace = told.get("__ns", os.environ.get("ROS_NAMESPACE", "")).strip("/")
    return "/" + "/".join(part for part in (namespace, told.get("__name", NODE_NAME)) if part)


class Kind(Enum):
    """What a node registers; the value is the end of the master's methods ``register...`` and ``unregister...``."""

    PUBLISHER = "Publisher"
    SUBSCRIBER = "Subscriber"
    SERVICE = "Service"


@dataclass(frozen=True)
class Registration:
    """One of them. ``type_name`` is empty for a service."""

    kind: Kind
    name: str
    type_name: str = ""


class _Handler(SimpleXMLRPCRequestHandler):
    """XML-RPC without a log line a request, for a peer that may hang."""

    timeout = 5.0
    rpc_paths = ()

    def log_message(self, *arguments: object) -> None:
        """Log nothing; ``http.server`` would write each request to stderr."""


class _Server(ThreadingMixIn, SimpleXMLRPCServer):
    daemon_threads = True
    block_on_close = False

    def __init__(self, address: str) -> None:
        self.address_family = socket.AF_INET6 if ":" in address else socket.AF_INET
        super().__init__((address, 0), _Handler, logRequests=False, allow_none=True)


class Ros1Node:
    """The node. Safe from several threads; what the master does not hear now it hears when ``register_again`` is called."""

    def __init__(self, name: str, master: Connection, *, host: str, topics_port: int, changed: PublishersChanged) -> None:
        """Listen for other nodes. ``changed`` is called with a topic and its publishers' URIs, from any thread."""
        self.name = name
        self.on_shutdown: Callable[[], None] = lambda: None
        self._on_parameters: Callable[[], None] | None = None
        self._master = master
        self._host = host
        self._topics_port = topics_port
        self._changed = changed
        self._lock = threading.Lock()
        self._registered: Counter[Registration] = Counter()  # several routes may share one
        self._untold: set[Registration] = set()
        self._server = _Server(bind_address(host))
        self._server.register_instance(_SlaveApi(self))
        self.uri = f"http://{in_uri(host)}:{self._server.server_address[1]}/"
        threading.Thread(target=self._server.serve_forever, kwargs={"poll_interval": 0.2}, name="ros1_node", daemon=True).start()

    @property
    def master_uri(self) -> str:
        """URI of the ROS master."""
        return self._master.uri

    def topics(self, kind: Kind) -> list[list[str]]:
        """Return names and types of what is published or subscribed to."""
        with self._lock:
            return [[one.name, one.type_name] for one in self._registered if one.kind is kind]

    def register(self, kind: Kind, name: str, type_name: str = "") -> None:
        """Register with the master; ``changed`` gets a subscribed topic's publishers. Service calls go to the port of the topics."""
        registration = Registration(kind, name, type_name)
        with self._lock:
            self._registered[registration] += 1
        self._tell(registration)

    def unregister(self, kind: Kind, name: str, type_name: str = "") -> None:
        """Unregister at the master, once the last registration of this kind and name is gone."""
        registration = Registration(kind, name, type_name)
        with self._lock:
            self._registered[registration] -= 1
            if self._registered[registration] > 0:
                return
            del self._registered[registration]
            self._untold.discard(registration)
        try:
            self._master.call(f"unregister{kind.value}", self.name, name, self._service_uri if kind is Kind.SERVICE else self.uri)
        except OSError as error:
            logger.debug("%s: %s", name, error)

    def register_again(self, *, only_untold: bool = False) -> None:
        """Tell the master everything, or what it has not heard yet."""
        with self._lock:
            todo = [one for one in self._registered if not only_untold or one in self._untold]
        for registration in todo:
            self._tell(registration)
        if self._on_parameters is not None and not only_untold:
            self.subscribe_parameters(self._on_parameters)

    def _tell(self, one: Registration) -> None:
        what = self._service_uri if one.kind is Kind.SERVICE else one.type_name
        try:
            answer = self._master.call(f"register{one.kind.value}", self.name, one.name, what, self.uri)
        except OSError:
            with self._lock:
                self._untold.add(one)
            return
        with self._lock:
            self._untold.discard(one)
        if one.kind is Kind.SUBSCRIBER:
            self._changed(one.name, list(answer))

    @property
    def _service_uri(self) -> str:
        return f"rosrpc://{in_uri(self._host)}:{self._topics_port}"

    def subscribe_parameters(self, changed: Callable[[], None]) -> None:
        """Call ``changed`` now, after a restart of the master, and whenever the master tells that a parameter has changed."""
        self._on_parameters = changed
        try:
            self._master.call("subscribeParam", self.name, self.uri, "/")
        except OSError as error:
            logger.debug("parameters: %s", error)
        changed()

    def parameter_changed(self) -> None:
        """Take the master's word that a parameter has changed."""
        if self._on_parameters is not None:
            self._on_parameters()

    def place_of_service(self, service: str) -> tuple[str, int] | None:
        """Ask the master where a service's server is: host and port; None when it knows none. Raises OSError or ValueError."""
        try:
            uri = str(self._master.call("lookupService", self.name, service))
        except RefusedError:
            return None
        host, _, port = uri.removeprefix("rosrpc://").rstrip("/").rpartition(":")
        return host.strip("[]"), int(port)

    def place_of(self, topic: str, publisher_uri: str) -> tuple[str, int]:
        """Ask a publisher where it sends a topic from: host and port. Raises OSError."""
        protocol = call_node(publisher_uri, "requestTopic", self.name, topic, [["TCPROS"]], within_s=ANSWER_WITHIN_S)
        if not protocol or protocol[0] != "TCPROS":
            raise OSError(f"{publisher_uri} does not speak TCPROS: {protocol}")
        return str(protocol[1]), int(protocol[2])

    def offers(self, topic: str) -> tuple[str, int] | None:
        """Return where subscribers connect to; None when the topic is not published here."""
        published = any(name == topic for name, _ in self.topics(Kind.PUBLISHER))
        return (self._host, self._topics_port) if published else None

    def changed(self, topic: str, publishers: list[str]) -> None:
        """Take the master's list of a topic's publishers."""
        self._changed(topic, publishers)

    def close(self) -> None:
        """Unregister everything and stop answering."""
        if self._on_parameters is not None:
            self._on_parameters = None
            try:
                self._master.call("unsubscribeParam", self.name, self.uri, "/")
            except OSError as error:
                logger.debug("parameters: %s", error)
        with self._lock:
            left = dict(self._registered)
        for one, number in left.items():
            for _ in range(number):
                self.unregister(one.kind, one.name, one.type_name)
        self._server.shutdown()
        self._server.server_close()


class _SlaveApi:
    """The slave API; each answer is ``[code, text, value]``. Names are the protocol's."""

    def __init__(self, node: Ros1Node) -> None:
        self._node = node

    def publisherUpdate(self, _caller: str, topic: str, publishers: list[str]) -> list[Any]:  # noqa: N802
        """Receive a topic's publishers from the master."""
        self._node.changed(topic, [str(uri) for uri in publishers])
        return [OK, "", 0]

    def requestTopic(self, _caller: str, topic: str, protocols: list[list[Any]]) -> list[Any]:  # noqa: N802
        """Return to a subscriber the address to connect to."""
        place = self._node.offers(topic)
        if place is None:
            return [FAILED, f"not a publisher of [{topic}]", []]
        if not any(protocol and protocol[0] == "TCPROS" for protocol in protocols):
            return [FAILED, "only TCPROS is spoken here", []]
        return [OK, f"ready on {place[0]}:{place[1]}", ["TCPROS", *place]]

    def getPid(self, _caller: str) -> list[Any]:  # noqa: N802
        """Return the bridge's process id."""
        return [OK, "", os.getpid()]

    def getMasterUri(self, _caller: str) -> list[Any]:  # noqa: N802
        """Return the URI of this node's master."""
        return [OK, "", self._node.master_uri]

    def getSubscriptions(self, _caller: str) -> list[Any]:  # noqa: N802
        """Return the subscribed topics."""
        return [OK, "", self._node.topics(Kind.SUBSCRIBER)]

    def getPublications(self, _caller: str) -> list[Any]:  # noqa: N802
        """Return the topics that the bridge publishes, each with its type."""
        return [OK, "", self._node.topics(Kind.PUBLISHER)]

    def getBusStats(self, _caller: str) -> list[Any]:  # noqa: N802
        """Tell nothing about connections: the bridge's own figures do."""
        return [OK, "see the bridge's figures", [[], [], []]]

    def getBusInfo(self, _caller: str) -> list[Any]:  # noqa: N802
        """Return no connections; the bridge's own figures have them."""
        return [OK, "see the bridge's figures", []]

    def paramUpdate(self, _caller: str, _key: str, _value: object) -> list[Any]:  # noqa: N802
        """Take the master's message that a parameter has changed."""
        self._node.parameter_changed()
        return [OK, "", 0]

    def shutdown(self, caller: str, reason: str = "") -> list[Any]:
        """End the bridge: another node has taken the name, or a user asks for it (rosnode kill)."""
        logger.warning("%s asks %s to shut down: %s", caller, self._node.name, reason or "no reason given")
        self._node.on_shutdown()
        return [OK, "", 0]
