"""``python -m alula_testing.attacks.unclosed ros1|ros2``: a user's script that calls a skill and ends without closing anything."""

from __future__ import annotations

import sys

READY_S = 60.0


def main() -> None:
    """Ask for a skill, say what came of it, and end."""
    if sys.argv[1] == "ros1":
        import rospy

        from skillset_ros1 import SkillsetClient

        rospy.init_node("unclosed", anonymous=True)
        client = SkillsetClient("navigation")
        assert client.wait_ready(READY_S)
        handle = client.start("hover", duration=1.0)
    else:
        from uav_client import Uav

        uav = Uav.connect(skillsets=["navigation"])
        handle = uav.navigation.hover(duration=1.0)  # type: ignore[assignment]  # of either world, it is a handle
    handle.interrupt()
    sys.stdout.write(f"{handle.get(READY_S).outcome}\n")


if __name__ == "__main__":
    main()
