"""``python -m alula_testing.attacks ros1|ros2``: see the package."""

from __future__ import annotations

import os
import sys
import threading
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from alula_testing.attacks.attacks import ATTACKS
from alula_testing.attacks.graph import LiveGraph, answer


@contextmanager
def ros1() -> Iterator[LiveGraph]:
    """Run a ROS master, and this process as a node."""
    from alula_testing.ros1 import running_master

    with running_master("attacker"):
        from skillset_ros1 import SkillsetClient

        graph = LiveGraph("ros1", lambda: SkillsetClient("navigation"))
        yield graph
        graph.close()


@contextmanager
def ros2() -> Iterator[LiveGraph]:
    """Claim a DDS domain, and initialise rclpy in it."""
    from alula_common.network import claim_domain

    claim = claim_domain()
    os.environ["ROS_DOMAIN_ID"] = str(claim.domain)
    import rclpy
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.node import Node

    from alula_testing.ros2 import spin
    from skill_runtime.ros2 import SkillsetClient

    rclpy.init()
    executor = SingleThreadedExecutor()

    def make_client() -> Any:
        node = Node("attacker")
        client = SkillsetClient(node, "navigation")
        executor.add_node(node)
        threading.Thread(target=spin, args=(executor,), daemon=True).start()
        return client

    graph = LiveGraph("ros2", make_client)
    yield graph
    graph.close()
    executor.shutdown(timeout_sec=5.0)
    rclpy.try_shutdown()
    claim.release()


def main() -> None:
    """Attack until stdin ends."""
    # Whatever prints to stdout goes to stderr: that line belongs to the answers.
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    with {"ros1": ros1, "ros2": ros2}[sys.argv[1]]() as graph:
        for line in sys.stdin:
            try:
                found = ATTACKS[line.strip()](graph)
            except Exception as error:  # noqa: BLE001 - the test must hear of it
                found = {"error": "".join(traceback.format_exception(error))}
            answers.write(answer(found))
            answers.flush()


if __name__ == "__main__":
    main()
