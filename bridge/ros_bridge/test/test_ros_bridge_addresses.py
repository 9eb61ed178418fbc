"""Computers that get another address, and addresses of IPv6: nodes that are known by their names are found again."""

import time

import pytest
from ros_bridge_networked import RELAY, BaseComputer, Links, all_carry_again, times_until_all_arrive
from ros_bridge_nodes import Ros2Peer

from alula_testing.networks import Network

CONFIG = """
topics:
  - {name: /moved/up, direction: ros1_to_ros2, type: std_msgs/String}
  - {name: /moved/down, direction: ros2_to_ros1, type: std_msgs/String}
  - {name: /moved/relay_in, direction: ros2_to_ros1, type: std_msgs/String}
  - {name: /moved/relay_out, direction: ros1_to_ros2, type: std_msgs/String}
services:
  - {name: /moved/in_ros1, server: ros1, type: std_srvs/SetBool, timeout_s: 3.0}
  - {name: /moved/in_ros2, server: ros2, type: std_srvs/SetBool, timeout_s: 3.0}
"""
AGAIN_WITHIN_S = 2.0 + 2.0
"""What a busy machine may add is in it: alone it takes 2 s."""


@pytest.fixture(scope="module")
def base(ros2_domain):
    with Network() as network:
        base = BaseComputer(network, by_name=True)
        yield base
        base.close()


@pytest.fixture(scope="module")
def bridge(base, tmp_path_factory):
    bridge = base.bridge(tmp_path_factory.mktemp("addresses"), CONFIG)
    yield bridge
    bridge.close()


@pytest.fixture(scope="module")
def probes(base, bridge):
    ros2 = Ros2Peer()
    links = Links(base, ros2)
    probes = {
        "topic to ROS 2": links.up("/moved/up"),
        "topic to ROS 1": links.down("/moved/down"),
        "service in ROS 1": links.in_ros1("/moved/in_ros1"),
        "service in ROS 2": links.in_ros2("/moved/in_ros2"),
    }
    base.run(str(RELAY), "/moved/relay_in", "/moved/relay_out")
    probes["roscpp"] = links.round_trip("/moved/relay_in", "/moved/relay_out")
    times_until_all_arrive(probes)
    yield probes
    ros2.tidy()
    ros2.close()


def test_every_link_carries_again_when_the_base_computer_comes_back_with_another_address(base, probes):
    def come_back_elsewhere():
        with base.cut():
            time.sleep(4.0)
            base.network.move(base.computer)

    for _ in range(2):
        all_carry_again(come_back_elsewhere, probes, AGAIN_WITHIN_S)
