"""The node /lidar_mapping: its core on ROS, and the service that saves the map."""

from __future__ import annotations

from typing import TYPE_CHECKING

import rospy
from std_srvs.srv import Trigger, TriggerResponse

from lidar_mapping.core import OUTPUTS, LidarMapping
from lidar_mapping.heap import give_back
from lidar_mapping.settings import MappingSettings
from node_core.ros import RosHost
from perception_core.ros import read_settings
from resource_reporter import ToldService

if TYPE_CHECKING:
    from std_srvs.srv import TriggerRequest


def serve_save(core: LidarMapping) -> ToldService:
    """Serve ``~save``."""

    def save(_request: TriggerRequest) -> TriggerResponse:
        try:
            return TriggerResponse(success=True, message=core.save())
        except OSError as error:
            return TriggerResponse(success=False, message=str(error))

    return ToldService("~save", Trigger, save)


def main() -> None:
    """Run the node until ROS shuts down."""
    give_back()
    rospy.init_node("lidar_mapping")
    host = RosHost(OUTPUTS, "mapping")
    core = LidarMapping(read_settings(MappingSettings()), host)
    _saving = serve_save(core)
    host.run(core)
    rospy.on_shutdown(core.save_if_new)
    rospy.spin()
