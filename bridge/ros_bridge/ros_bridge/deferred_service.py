"""Services of rclpy that answer when they can: the callback only takes the request, ``reply`` sends the response, from any thread."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rclpy.node import Node

Header = Any  # rclpy's id of a request and of its client
Take = Callable[[Any, Header], None]


@dataclass(frozen=True)
class _DeferredResponse:
    """Stands for a response that will be sent."""

    request: Any


class DeferredService:
    """A service whose requests are taken in the executor's thread by ``take(request, header)``."""

    def __init__(self, node: Node, service_class: Any, name: str, take: Take) -> None:
        """Offer the service; requests come as soon as the node is spun."""
        self._node = node
        self._take = take
        # rclpy sends what the callback returns at once, and a callback that awaits makes its executor poll without a pause.
        # So the callback returns a stand-in, and its sending hands the request over.
        self._service = node.create_service(service_class, name, lambda request, _: _DeferredResponse(request))
        self._send = self._service.send_response
        self._service.send_response = self._hand_over

    def _hand_over(self, response: _DeferredResponse, header: Header) -> None:
        self._take(response.request, header)

    def reply(self, response: Any, header: Header) -> None:
        """Send the response to the request with this header, from any thread."""
        self._send(response, header)

    def close(self) -> None:
        """Destroy the service; requests without a response get none."""
        self._node.destroy_service(self._service)
