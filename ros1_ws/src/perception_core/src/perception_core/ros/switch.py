"""The service ``~enable`` of a function that runs on demand."""

from __future__ import annotations

from typing import TYPE_CHECKING

import rospy
from std_srvs.srv import SetBool, SetBoolResponse

from resource_reporter import ToldService

if TYPE_CHECKING:
    from collections.abc import Callable

    from std_srvs.srv import SetBoolRequest


class EnableSwitch:
    """Serve ``~enable``, and keep the answer in the parameter ``~enabled``: a node started again after a crash goes on as it was."""

    def __init__(self, *, enabled: bool, on_change: Callable[[bool], None] | None = None) -> None:
        self.enabled = enabled
        self._on_change = on_change
        self._service = ToldService("~enable", SetBool, self._serve)

    def _serve(self, request: SetBoolRequest) -> SetBoolResponse:
        self.enabled = bool(request.data)
        rospy.set_param("~enabled", self.enabled)
        if self._on_change is not None:
            self._on_change(self.enabled)
        return SetBoolResponse(success=True, message="enabled" if self.enabled else "disabled")
