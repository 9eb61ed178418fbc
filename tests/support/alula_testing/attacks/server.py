"""``python -m alula_testing.attacks.server ros1|ros2``: serves the drone's navigation until it is ended; says when it does."""

from __future__ import annotations

import sys
from typing import Any

from navigation_managers.hooks import ABSTRACT_HOOKS
from navigation_managers.model import SKILLSET

from alula_testing.attacks.graph import READY
from alula_testing.attacks.hooks import tame_hooks
from skill_runtime.hooks import SkillHooks


def make_hooks(_: Any) -> dict[str, SkillHooks]:
    """Return the hooks of the managers."""
    sys.stdout.write(f"{READY}\n")
    sys.stdout.flush()
    return tame_hooks(ABSTRACT_HOOKS)


def main() -> None:
    """Serve."""
    if sys.argv[1] == "ros1":
        import navigation_interfaces.msg as interfaces

        from skillset_ros1 import run_skillset as serve_ros1

        serve_ros1(SKILLSET, interfaces, make_hooks)
        return
    import navigation_interfaces.action as actions

    from skill_runtime.ros2 import run_skillset

    run_skillset(SKILLSET, actions, make_hooks, arguments=[])


if __name__ == "__main__":
    main()
