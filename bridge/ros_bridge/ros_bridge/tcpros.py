"""TCPROS connection headers, and what ROS 1 nodes tell in them: a connection that is closed again as soon as the header is there.

A header is a length and fields ``name=value``, each with its length (ROS wiki, "ROS/Connection Header"). A publisher's has its type's MD5
sum and full definition, a service's its type (ROS wiki, "ROS/TCPROS").
"""

from __future__ import annotations

import logging
import socket
import struct
from collections.abc import Mapping
from urllib.parse import urlsplit

from ros_bridge.errors import WireError
from ros_bridge.master import SilentError, call_node

logger = logging.getLogger("ros_bridge")

WITHIN_S = 1.0
MOST_BYTES = 1 << 20
LENGTH = struct.Struct("<I")


def encode_header(fields: Mapping[str, str]) -> bytes:
    """Return a connection header, its length first."""
    encoded = [f"{name}={value}".encode() for name, value in fields.items()]
    body = b"".join(LENGTH.pack(len(field)) + field for field in encoded)
    return LENGTH.pack(len(body)) + body


def decode_header(body: bytes) -> dict[str, str]:
    """Return the fields of a header without its length; raises WireError."""
    fields = {}
    while body:
        if len(body) < LENGTH.size or (size := LENGTH.unpack_from(body)[0]) > len(body) - LENGTH.size:
            raise WireError(f"a connection header ends early: {len(body)} bytes are left")
        name, _, value = body[LENGTH.size : LENGTH.size + size].decode(errors="replace").partition("=")
        fields[name] = value
        body = body[LENGTH.size + size :]
    return fields


def publisher_header(node_uri: str, topic: str, caller_id: str) -> dict[str, str] | None:
    """Return the header with which a node offers a topic; None when it answers otherwise than it should, or is not there.

    Raises TimeoutError when it does not answer in time.
    """
    wanted = {"topic": topic, "type": "*", "md5sum": "*", "callerid": caller_id, "message_definition": ""}
    try:
        _, host, port = call_node(node_uri, "requestTopic", caller_id, topic, [["TCPROS"]], within_s=WITHIN_S)
        return _exchange(str(host), int(port), wanted)
    except SilentError as error:
        raise TimeoutError(str(error)) from error
    except TimeoutError:
        raise
    except (OSError, ValueError, TypeError, WireError) as error:
        logger.debug("%s says nothing about %s: %s", node_uri, topic, error)
        return None


def service_header(service: str, service_uri: str, caller_id: str) -> dict[str, str]:
    """Return the header with which a node offers a service: its type and MD5 sum; empty when it answers otherwise, or is not there.

    Raises TimeoutError when it does not answer in time.
    """
    wanted = {"service": service, "probe": "1", "md5sum": "*", "callerid": caller_id}
    try:
        parts = urlsplit(service_uri)
        return _exchange(str(parts.hostname), int(parts.port or 0), wanted)
    except TimeoutError:
        raise
    except (OSError, ValueError, WireError) as error:
        logger.debug("%s says nothing about %s: %s", service_uri, service, error)
        return {}


def _exchange(host: str, port: int, wanted: Mapping[str, str]) -> dict[str, str]:
    """Send a header and return the peer's; raises OSError or WireError."""
    with socket.create_connection((host, port), timeout=WITHIN_S) as connection, connection.makefile("rb") as stream:
        connection.sendall(encode_header(wanted))
        length = LENGTH.unpack(_exactly(stream.read(LENGTH.size), LENGTH.size))[0]
        if length > MOST_BYTES:
            raise WireError(f"a connection header would have {length} bytes")
        return decode_header(_exactly(stream.read(length), length))


def _exactly(data: bytes, size: int) -> bytes:
    if len(data) != size:
        raise WireError(f"a connection header ends early: {len(data)} of {size} bytes")
    return data
