"""The base of a skill whose function is one call of a service."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from alula.runtime.core.execution import Execution
from skillset_ros2.function_skill import Call, Ending, FunctionSkill, filled, said_by
from skillset_ros2.watch import Watch


@dataclass(eq=False)
class ServiceCall(Call):
    """A call; ``pending``: the future of its answer, None before the server was there."""

    client: Any = None
    request: Any = None
    pending: Any = None


class ServiceSkill(FunctionSkill[ServiceCall]):
    """A skill whose function is a service: the answer's ``success`` gives the result, its ``message`` the reason.

    An interruption calls ``stop_server`` and is done when that has answered; without one it only stops waiting, as the caller of a
    service can't take its call back.
    """

    service: ClassVar[Any]
    """The service's type."""
    stop_service: ClassVar[Any] = None
    """The type of the service that stops what the call has started."""
    stop_server: ClassVar[str] = ""
    """Its name, without a slash in front; "": there is none."""
    results: ClassVar[Mapping[Any, str]] = {}
    """The result for each value of ``success``."""

    def __init__(self, watch: Watch) -> None:
        super().__init__(watch)
        self._clients: dict[str, Any] = {}
        if self.stop_server:
            self._stops = watch.node.create_client(self.stop_service, self.stop_server)

    def request(self, inputs: Any) -> Any:
        """Return the request; by default the inputs are in its fields of the same names."""
        return filled(self.service.Request(), inputs, f"the request to {self.server}")

    def stop_request(self) -> Any:
        """Return the request that stops it."""
        return self.stop_service.Request()

    def ending(self, execution: Execution, response: Any) -> Ending:  # noqa: ARG002
        """Return how this response ends the execution."""
        return Ending(self.results[response.success], said_by(response))

    def on_start(self) -> None:
        """Call the service that stops what was started before."""
        if self.stop_server:
            self.call_at_start(self.stop_service, self.stop_server, self.stop_request())

    def on_dispatch(self, execution: Execution) -> None:
        """Call the service, as soon as it is there."""
        server, request = self.server_for(execution.inputs), self.request(execution.inputs)
        with self._lock:
            client = self._clients.get(server) or self._clients.setdefault(server, self.watch.node.create_client(self.service, server))
            self.begin(ServiceCall(execution, server, self.watch.now_s, client=client, request=request))

    def on_interrupt(self, execution: Execution) -> bool | None:
        """Call the service that stops it; wait no more for the answer."""
        call = self.forget(execution)
        if call is not None and call.pending is not None:
            call.client.remove_pending_request(call.pending)
        if call is None or not self.stop_server:
            return None
        with self._lock:
            self.begin(ServiceCall(execution, self.stop_server, self.watch.now_s, True, self._stops, self.stop_request()))
        return False

    def on_emergency(self, execution: Execution) -> None:
        """Stop waiting for the answer."""
        self.forget(execution)

    def look(self, call: ServiceCall) -> str:
        """Call the service once it is there; return why it is lost, or ""."""
        if call.pending is None and call.client.service_is_ready() and not self.stops_first:
            self.forget_late_stop()
            call.since_s = self.watch.now_s
            call.pending = call.client.call_async(call.request)
            call.pending.add_done_callback(lambda future: self._on_answer(call, future.result()))
        elif self.waited_s(call) > self.answer_s:
            if call.pending is None:
                return "is not there"
            call.client.remove_pending_request(call.pending)
            return f"does not answer for {self.answer_s:g} s"
        return ""

    def _on_answer(self, call: ServiceCall, response: Any) -> None:
        if response is not None:
            self.end(call, lambda: self.ending(call.execution, response))
