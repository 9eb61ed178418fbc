"""`python -m rover_robot.serve SKILLSET`: the managers of one of the rover's skillsets, with their hooks."""

from __future__ import annotations

import importlib
import sys

from skillset_ros2 import run_skillset


def main() -> None:
    """Serve the skillset that the command line names until SIGINT or SIGTERM."""
    name = sys.argv[1]
    model = importlib.import_module(f"{name}_managers.model")
    interfaces = importlib.import_module(f"{name}_interfaces.action")
    hooks = importlib.import_module(f"rover_robot.hooks.{name}")
    run_skillset(model.SKILLSET, interfaces, hooks.make_hooks, data_bindings=model.DATA_TOPICS, arguments=sys.argv[2:], again=[name])


if __name__ == "__main__":
    main()
