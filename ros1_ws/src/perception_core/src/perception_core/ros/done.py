"""Say which measurement a node is done with, so that a simulator can wait and a person can see how far behind the node is."""

from __future__ import annotations

import rospy
from std_msgs.msg import Header

from perception_core.poses import NS


class DoneReporter:
    """Publishes ``~done``, a Header with the stamp of each measurement that the node has dealt with, good or bad."""

    def __init__(self) -> None:
        self._publisher = rospy.Publisher("~done", Header, queue_size=5, tcp_nodelay=True)

    def done(self, stamp_ns: int) -> None:
        """Tell that nothing is left to do for the measurement made at ``stamp_ns``."""
        self._publisher.publish(Header(stamp=rospy.Time(stamp_ns // NS, stamp_ns % NS)))
