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

    def __init__(self, switch: Callable[[bool], None]) -> None:
        self._switch = switch
        self._service = ToldService("~enable", SetBool, self._serve)

    def _serve(self, request: SetBoolRequest) -> SetBoolResponse:
        enabled = bool(request.data)
        rospy.set_param("~enabled", enabled)
        self._switch(enabled)
        return SetBoolResponse(success=True, message="enabled" if enabled else "disabled")
