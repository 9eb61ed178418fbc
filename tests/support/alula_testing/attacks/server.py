"""``python -m alula_testing.attacks.server ros1|ros2 [SEED]``: serves the drone's navigation until it is ended; says when it does.

With a seed, its functions misbehave at random, and a hook that does not return within ``HOOK_TIMEOUT_S`` is overdue.
"""

from __future__ import annotations

import random
import sys
import threading
from collections.abc import Callable
from typing import Any

from navigation_managers.hooks import ABSTRACT_HOOKS
from navigation_managers.model import SKILLSET

from alula.runtime.hooks import SkillHooks
from alula_testing.attacks.graph import READY
from alula_testing.attacks.hooks import hanging, random_hooks, tame_hooks

HOOK_TIMEOUT_S = 2.0
HANGS_S = 3.0


def after(seconds: float, job: Callable[[], object]) -> None:
    """Have a job done after seconds of wall clock."""
    timer = threading.Timer(seconds, job)
    timer.daemon = True
    timer.start()


def make_hooks(_: Any) -> dict[str, SkillHooks]:
    """Return the hooks of the managers."""
    sys.stdout.write(f"{READY}\n")
    sys.stdout.flush()
    if len(sys.argv) > 2:
        return random_hooks(ABSTRACT_HOOKS, after, random.Random(int(sys.argv[2])), hanging(HANGS_S))  # noqa: S311
    return tame_hooks(ABSTRACT_HOOKS)


def main() -> None:
    """Serve."""
    hasty = len(sys.argv) > 2
    if sys.argv[1] == "ros1":
        import navigation_interfaces.msg as interfaces
        import rospy

        from skillset_ros1 import run_skillset as serve_ros1

        if hasty:
            rospy.set_param(f"/{SKILLSET.name}/hook_timeout_s", HOOK_TIMEOUT_S)
        serve_ros1(SKILLSET, interfaces, make_hooks)
        return
    import navigation_interfaces.action as actions

    from skillset_ros2 import run_skillset

    run_skillset(SKILLSET, actions, make_hooks, arguments=["--ros-args", "-p", f"hook_timeout_s:={HOOK_TIMEOUT_S}"] if hasty else [])


if __name__ == "__main__":
    main()
