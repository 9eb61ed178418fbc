"""The managers of a robot's skillsets in one process: ``python -m skillset_ros2.managers SKILLSET=MODULE:FACTORY... [--ros-args ...]``.

``FACTORY`` of ``MODULE`` makes the hooks of a skillset; what was generated of its model is found by the skillset's name. The options are
those of ``run_skillset``. Exits with 2 where one of them can't be served.
"""

from __future__ import annotations

import importlib
import re
import sys
from collections.abc import Sequence

from alula.common.ros_arguments import ROS_ARGUMENTS
from skillset_ros2.node import HooksFactory
from skillset_ros2.spin import Served, run_skillsets

USAGE = "write SKILLSET=MODULE:FACTORY for each skillset, as base=rover_skills.base:make_hooks"
_SERVED = re.compile(r"([a-z][a-z0-9_]*)=(.+)")
CANT_RUN = 2


def main(arguments: Sequence[str] | None = None) -> int:
    """Serve what the command line names until SIGINT or SIGTERM; return the exit code."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    split = words.index(ROS_ARGUMENTS) if ROS_ARGUMENTS in words else len(words)
    named = {word: found for word in words[:split] if (found := _SERVED.fullmatch(word))}
    places = {found[1]: found[2] for found in named.values()}
    if not places:
        sys.stderr.write(f"managers: {USAGE}\n")
        return CANT_RUN
    try:
        served = [served_by(name, place) for name, place in places.items()]
    except (ImportError, ValueError) as error:
        sys.stderr.write(f"managers: {error}\n")
        return CANT_RUN
    run_skillsets(served, [word for word in words if word not in named])
    return 0


def served_by(skillset: str, place: str) -> Served:
    """Return a skillset with the hooks of ``MODULE:FACTORY``; raises ImportError or ValueError, which name it."""
    try:
        model = importlib.import_module(f"{skillset}_managers.model")
        interfaces = importlib.import_module(f"{skillset}_interfaces.action")
    except ModuleNotFoundError as error:
        raise ImportError(f"{skillset}: there is no {error.name}; is it a skillset of this robot, and was `alula setup` run?") from error
    try:
        factory = find_factory(place)
    except (ImportError, ValueError) as error:
        raise type(error)(f"{skillset}={place}: {error}") from error
    return Served(model.SKILLSET, interfaces, factory, model.DATA_TOPICS, (f"{skillset}={place}",))


def find_factory(place: str) -> HooksFactory:
    """Return the function ``MODULE:FACTORY`` that makes the hooks of a node; raise ImportError or ValueError when there is none."""
    module, _, name = place.partition(":")
    if not name:
        raise ValueError("it should be MODULE:FACTORY, as rover_skills.base:make_hooks")
    found: HooksFactory | None = getattr(importlib.import_module(module), name, None)
    if not callable(found):
        raise ValueError(f"{module} has no function {name}")  # noqa: TRY004 - a slip in the place that was given
    return found


if __name__ == "__main__":
    sys.exit(main())
