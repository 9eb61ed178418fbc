"""``python -m alula_testing.traces ros1|ros2``: plays the scripts that come as lines of JSON on stdin, answers with their traces."""

from __future__ import annotations

import json
import os
import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager

from alula_testing.traces.play import play
from alula_testing.traces.script import Script
from alula_testing.traces.stage import MakeStage


@contextmanager
def ros1() -> Iterator[MakeStage]:
    """Run a ROS master, and this process as a node."""
    from alula_testing.ros1 import running_master

    with running_master("player"):
        from alula_testing.traces.stage_ros1 import Ros1Stage

        yield Ros1Stage


@contextmanager
def ros2() -> Iterator[MakeStage]:
    """Claim a DDS domain, and initialise rclpy in it."""
    from alula.common.network import claim_domain

    claim = claim_domain()
    os.environ["ROS_DOMAIN_ID"] = str(claim.domain)
    import rclpy

    from alula_testing.traces.stage_ros2 import Ros2Stage

    rclpy.init()
    yield Ros2Stage
    rclpy.try_shutdown()
    claim.release()


def main() -> None:
    """Play until stdin ends."""
    # Whatever prints to stdout goes to stderr: that line belongs to the traces.
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    with {"ros1": ros1, "ros2": ros2}[sys.argv[1]]() as make_stage:
        for line in sys.stdin:
            try:
                answer = play(Script.from_plain(json.loads(line)), make_stage)
            except Exception as error:  # noqa: BLE001 - the test that asked must hear of it
                answer = {"error": "".join(traceback.format_exception(error))}
            answers.write(json.dumps(answer) + "\n")
            answers.flush()


if __name__ == "__main__":
    main()
