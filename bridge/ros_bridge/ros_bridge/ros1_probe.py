"""Ask ROS 1 nodes what they would tell a subscriber or client: the header of a TCPROS connection that is closed again at once.

A publisher's header has its type's MD5 sum and full definition (ROS wiki, "ROS/TCPROS"), a service's its type.
"""

from __future__ import annotations

import http.client
import logging
import socket
from io import BytesIO
from typing import Any
from urllib.parse import urlsplit
from xmlrpc.client import Error as XmlRpcError
from xmlrpc.client import ServerProxy

from ros_bridge import two_worlds
from ros_bridge.ros1_call import TimedTransport

two_worlds.import_ros1()

import rosgraph.network  # noqa: E402 - only after ROS 1 is there

logger = logging.getLogger("ros_bridge")

WITHIN_S = 1.0
HEADER_BYTES = 65536


def publisher_header(node_uri: str, topic: str, caller_id: str) -> dict[str, str] | None:
    """Return the header with which a node offers a topic; None when it does not answer as it should."""
    try:
        with ServerProxy(node_uri, transport=TimedTransport(WITHIN_S)) as node:
            answer: Any = node.requestTopic(caller_id, topic, [["TCPROS"]])
        _, host, port = answer[2]
        wanted = {"topic": topic, "type": "*", "md5sum": "*", "callerid": caller_id, "message_definition": ""}
        return _exchange(str(host), int(port), wanted)
    except (
        OSError,
        XmlRpcError,
        http.client.HTTPException,
        rosgraph.network.ROSHandshakeException,
        ValueError,
        IndexError,
        TypeError,
    ) as error:
        logger.debug("%s says nothing about %s: %s", node_uri, topic, error)
        return None


def service_type(service: str, service_uri: str, caller_id: str) -> str | None:
    """Return the type of a service; None when its node does not answer as it should."""
    parts = urlsplit(service_uri)
    try:
        header = _exchange(
            str(parts.hostname), int(parts.port or 0), {"service": service, "probe": "1", "md5sum": "*", "callerid": caller_id}
        )
    except (OSError, rosgraph.network.ROSHandshakeException, ValueError) as error:
        logger.debug("%s says nothing about %s: %s", service_uri, service, error)
        return None
    return header.get("type")


def _exchange(host: str, port: int, wanted: dict[str, str]) -> dict[str, str]:
    with socket.create_connection((host, port), timeout=WITHIN_S) as connection:
        rosgraph.network.write_ros_handshake_header(connection, wanted)
        header: dict[str, str] = rosgraph.network.read_ros_handshake_header(connection, BytesIO(), HEADER_BYTES)
        return header
