"""The live worlds: a ROS master or a DDS domain of their own, with this process as a node."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from typing import Any

from alula_testing.attacks.graph import LiveGraph


@contextmanager
def ros1() -> Iterator[LiveGraph]:
    """Run a ROS master, and this process as a node."""
    from alula_testing.ros1 import running_master

    with running_master("attacker"):
        from skillset_ros1 import SkillsetClient

        graph = LiveGraph("ros1", lambda: SkillsetClient("navigation"))
        try:
            yield graph
        finally:
            graph.close()


@contextmanager
def ros2() -> Iterator[LiveGraph]:
    """Claim a DDS domain, and initialise rclpy in it."""
    from alula.common.network import claim_domain

    claim = claim_domain()
    os.environ["ROS_DOMAIN_ID"] = str(claim.domain)
    import rclpy
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.node import Node

    from alula_testing.ros2 import spin
    from skillset_ros2 import SkillsetClient

    rclpy.init()
    executors: list[Any] = []
    threads: list[threading.Thread] = []

    def make_client() -> Any:
        """Return a client with a node, an executor and a thread of its own."""
        node = Node(f"attacker_{len(executors)}")
        client = SkillsetClient(node, "navigation")
        executors.append(SingleThreadedExecutor())
        executors[-1].add_node(node)
        threads.append(threading.Thread(target=spin, args=(executors[-1],), daemon=True))
        threads[-1].start()
        return client

    graph = LiveGraph("ros2", make_client)
    try:
        yield graph
    finally:
        graph.close()
        for executor in executors:
            executor.shutdown(timeout_sec=5.0)
        for thread in threads:
            thread.join(5.0)
        rclpy.try_shutdown()
        claim.release()


WORLDS: Mapping[str, Callable[[], AbstractContextManager[LiveGraph]]] = {"ros1": ros1, "ros2": ros2}
