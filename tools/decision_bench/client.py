"""A client that says when skillsets can be called: ``python -m decision_bench.client SKILLSET...``, told by two lines on stdout."""

from __future__ import annotations

import sys

from skillset_ros2 import Robot

READY_S = 120.0


def main() -> None:
    """Say that it listens, and that all can be called."""
    sys.stdout.write("listens\n")
    sys.stdout.flush()
    with Robot.connect(*sys.argv[1:], timeout_s=READY_S):
        sys.stdout.write("ready\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
