"""The operator's page with robots reached over ROS 2: ``python -m skill_panel.console``, see ``alula.cli.console``."""

from __future__ import annotations

import sys

from alula.cli.console import main
from alula.console.link import Link


def ros_link() -> Link:
    """Make the link; imported when a robot is reached first, for it takes its time."""
    from skill_panel.ros_link import RosLink

    return RosLink()


if __name__ == "__main__":
    sys.exit(main(make_link=ros_link))
