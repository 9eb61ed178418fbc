"""What is promised of service calls, by the path through rospy and rclpy: the live tests again, with a bridge that has no data plane."""

from types import SimpleNamespace

import pytest
from ros_bridge_harness import BridgeProcess
from test_ros_bridge_live import (  # noqa: F401 - pytest finds tests by their names
    CONFIG,
    test_response_without_a_flag_is_not_sent_at_all,
    test_ros1_client_calls_a_ros2_server,
    test_ros1_client_gets_an_error_when_the_ros2_server_raises_or_goes,
    test_ros1_client_gets_an_error_when_there_is_no_ros2_server,
    test_ros2_client_calls_a_ros1_server_until_it_goes_and_its_successor_comes,
    test_ros2_client_gets_a_refusal_when_the_ros1_server_fails,
    test_ros2_client_gets_a_refusal_when_there_is_no_ros1_server,
)


@pytest.fixture(scope="module")
def bridge(master, ros2_domain, tmp_path_factory):
    without = SimpleNamespace(environment={**master.environment, "ROS_BRIDGE_NATIVE": "/no/such/library"})
    process = BridgeProcess(without, tmp_path_factory.mktemp("python_bridge"), CONFIG)
    process.wait_running()
    assert any("is not built" in line for line in process.lines)
    yield process
    process.close()
