"""A ROS 1 node without rospy: it registers what it publishes, subscribes to and serves with the master, and answers other nodes' questions.

It speaks the master and slave APIs (ROS wiki, "ROS/Master_API", "ROS/Slave_API"); messages themselves go through the native data plane.
"""

from __future__ import annotations

import http.client
import logging
import os
import threading
from collections.abc import Callable
from socketserver import ThreadingMixIn
from typing import Any
from xmlrpc.client import Error as XmlRpcError
from xmlrpc.client import ServerProxy
from xmlrpc.server import SimpleXMLRPCRequestHandler, SimpleXMLRPCServer

from ros_bridge.ros1_call import TimedTransport

logger = logging.getLogger("ros_bridge")

ANSWER_WITHIN_S = 2.0
OK, FAILED = 1, 0
PublishersChanged = Callable[[str, list[str]], None]
UNREACHABLE = (OSError, XmlRpcError, http.client.HTTPException)


class SaysNoError(OSError):
    """A master or node has answered, and says no."""


def ask(uri: str, method: str, *arguments: object) -> Any:
    """Call a master's or node's method; return the value of its answer.

    Raises:
        SaysNoError: It says no.
        OSError: It does not answer.
    """
    try:
        with ServerProxy(uri, transport=TimedTransport(ANSWER_WITHIN_S)) as proxy:
            code, text, value = getattr(proxy, method)(*arguments)
    except (XmlRpcError, http.client.HTTPException, ValueError, TypeError) as error:
        raise OSError(f"{uri}: {error}") from error
    if code != OK:
        raise SaysNoError(f"{uri}: {text}")
    return value


class _Handler(SimpleXMLRPCRequestHandler):
    """XML-RPC without a log line a request, for a peer that may hang."""

    timeout = 5.0
    rpc_paths = ()

    def log_message(self, *arguments: object) -> None:
        """Say nothing."""


class _Server(ThreadingMixIn, SimpleXMLRPCServer):
    daemon_threads = True
    block_on_close = False


class Ros1Node:
    """The node. Safe from several threads; what the master does not hear now it hears when ``register_again`` is called."""

    def __init__(self, name: str, master_uri: str, *, host: str, bind_address: str, topics_port: int, changed: PublishersChanged) -> None:
        """Listen for other nodes. ``changed`` is called with a topic and its publishers' URIs, from any thread."""
        self.name = name
        self._master_uri = master_uri
        self._host = host
        self._topics_port = topics_port
        self._changed = changed
        self._lock = threading.Lock()
        self._subscribed: dict[str, str] = {}
        self._published: dict[str, str] = {}
        self._served: dict[str, str] = {}
        self._untold: set[tuple[str, str]] = set()
        self._server = _Server((bind_address, 0), _Handler, logRequests=False, allow_none=True)
        self._server.register_instance(_Answers(self))
        self.uri = f"http://{host}:{self._server.server_address[1]}/"
        threading.Thread(target=self._server.serve_forever, kwargs={"poll_interval": 0.2}, name="ros1_node", daemon=True).start()

    @property
    def master_uri(self) -> str:
        """Where the master is."""
        return self._master_uri

    def topics(self, kind: str) -> list[list[str]]:
        """Return names and types of what is ``published`` or ``subscribed``."""
        with self._lock:
            return [[name, type_name] for name, type_name in (self._published if kind == "published" else self._subscribed).items()]

    def subscribe(self, topic: str, type_name: str) -> None:
        """Tell the master; its publishers are told to ``changed``."""
        with self._lock:
            self._subscribed[topic] = type_name
        self._tell("Subscriber", topic, type_name)

    def publish(self, topic: str, type_name: str) -> None:
        """Tell the master."""
        with self._lock:
            self._published[topic] = type_name
        self._tell("Publisher", topic, type_name)

    def serve(self, service: str) -> None:
        """Tell the master that calls of a service go to the port of the topics."""
        with self._lock:
            uri = self._served[service] = f"rosrpc://{self._host}:{self._topics_port}"
        self._tell("Service", service, uri)

    def unsubscribe(self, topic: str) -> None:
        """Tell the master that it is over."""
        self._forget("Subscriber", self._subscribed, topic, self.uri)

    def unpublish(self, topic: str) -> None:
        """Tell the master that it is over."""
        self._forget("Publisher", self._published, topic, self.uri)

    def unserve(self, service: str) -> None:
        """Tell the master that it is over."""
        self._forget("Service", self._served, service, f"rosrpc://{self._host}:{self._topics_port}")

    def register_again(self, *, only_untold: bool = False) -> None:
        """Tell the master everything, or what it has not heard yet."""
        with self._lock:
            kinds = {"Publisher": self._published, "Subscriber": self._subscribed, "Service": self._served}
            todo = [(kind, *entry) for kind, table in kinds.items() for entry in table.items()]
            todo = [entry for entry in todo if not only_untold or entry[:2] in self._untold]
        for entry in todo:
            self._tell(*entry)

    def _tell(self, kind: str, name: str, type_or_uri: str) -> None:
        """Register a topic with its type, or a service with where it is."""
        try:
            answer = ask(self._master_uri, f"register{kind}", self.name, name, type_or_uri, self.uri)
        except OSError:
            with self._lock:
                self._untold.add((kind, name))
            return
        with self._lock:
            self._untold.discard((kind, name))
        if kind == "Subscriber":
            self._changed(name, list(answer))

    def _forget(self, kind: str, table: dict[str, str], name: str, uri: str) -> None:
        with self._lock:
            self._untold.discard((kind, name))
            if table.pop(name, None) is None:
                return
        try:
            ask(self._master_uri, f"unregister{kind}", self.name, name, uri)
        except OSError as error:
            logger.debug("%s: %s", name, error)

    def place_of_service(self, service: str) -> tuple[str, int] | None:
        """Ask the master where a service's server is: host and port; None when it knows none. Raises OSError or ValueError."""
        try:
            uri = str(ask(self._master_uri, "lookupService", self.name, service))
        except SaysNoError:
            return None
        host, _, port = uri.removeprefix("rosrpc://").rstrip("/").rpartition(":")
        return host, int(port)

    def place_of(self, topic: str, publisher_uri: str) -> tuple[str, int]:
        """Ask a publisher where it sends a topic from: host and port. Raises OSError."""
        protocol = ask(publisher_uri, "requestTopic", self.name, topic, [["TCPROS"]])
        if not protocol or protocol[0] != "TCPROS":
            raise OSError(f"{publisher_uri} does not speak TCPROS: {protocol}")
        return str(protocol[1]), int(protocol[2])

    def offers(self, topic: str) -> tuple[str, int] | None:
        """Return where subscribers connect to; None when the topic is not published here."""
        with self._lock:
            return (self._host, self._topics_port) if topic in self._published else None

    def changed(self, topic: str, publishers: list[str]) -> None:
        """Take the master's word on who publishes a topic."""
        self._changed(topic, publishers)

    def close(self) -> None:
        """Unregister everything and stop answering."""
        for topic, _ in self.topics("subscribed"):
            self.unsubscribe(topic)
        for topic, _ in self.topics("published"):
            self.unpublish(topic)
        for service in tuple(self._served):
            self.unserve(service)
        self._server.shutdown()
        self._server.server_close()


class _Answers:
    """The slave API; each answer is ``[code, text, value]``. Names are the protocol's."""

    def __init__(self, node: Ros1Node) -> None:
        self._node = node

    def publisherUpdate(self, _caller: str, topic: str, publishers: list[str]) -> list[Any]:  # noqa: N802
        """Hear from the master who publishes a topic."""
        self._node.changed(topic, [str(uri) for uri in publishers])
        return [OK, "", 0]

    def requestTopic(self, _caller: str, topic: str, protocols: list[list[Any]]) -> list[Any]:  # noqa: N802
        """Tell a subscriber where to connect to."""
        place = self._node.offers(topic)
        if place is None:
            return [FAILED, f"not a publisher of [{topic}]", []]
        if not any(protocol and protocol[0] == "TCPROS" for protocol in protocols):
            return [FAILED, "only TCPROS is spoken here", []]
        return [OK, f"ready on {place[0]}:{place[1]}", ["TCPROS", *place]]

    def getPid(self, _caller: str) -> list[Any]:  # noqa: N802
        """Tell the process's number."""
        return [OK, "", os.getpid()]

    def getMasterUri(self, _caller: str) -> list[Any]:  # noqa: N802
        """Tell which master this node belongs to."""
        return [OK, "", self._node.master_uri]

    def getSubscriptions(self, _caller: str) -> list[Any]:  # noqa: N802
        """Tell what is subscribed to."""
        return [OK, "", self._node.topics("subscribed")]

    def getPublications(self, _caller: str) -> list[Any]:  # noqa: N802
        """Tell what is published."""
        return [OK, "", self._node.topics("published")]

    def getBusStats(self, _caller: str) -> list[Any]:  # noqa: N802
        """Tell nothing about connections: the bridge's own figures do."""
        return [OK, "see the bridge's figures", [[], [], []]]

    def getBusInfo(self, _caller: str) -> list[Any]:  # noqa: N802
        """Tell nothing about connections."""
        return [OK, "see the bridge's figures", []]

    def paramUpdate(self, _caller: str, _key: str, _value: object) -> list[Any]:  # noqa: N802
        """Take a parameter's change; none was subscribed to."""
        return [OK, "", 0]

    def shutdown(self, caller: str, reason: str = "") -> list[Any]:
        """Refuse: the bridge ends by its own node (``/ros_bridge``), with both halves together."""
        logger.warning("%s asks %s to shut down (%s): ask the bridge's main node", caller, self._node.name, reason)
        return [FAILED, "ask the bridge's main node", 0]
