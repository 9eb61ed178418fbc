"""A core's host on a live graph: when others may take the node for ready."""

from __future__ import annotations

import rosgraph
import rospy
from std_msgs.msg import Header

from alula_testing.waits import until
from node_core.core import Input
from node_core.ros import RosHost

BUFFER_BYTES = 1 << 16


def advertised(topic: str) -> bool:
    published, _, _ = rosgraph.Master(rospy.get_name()).getSystemState()
    return topic in dict(published)


class Core:
    """A core with two inputs that notes whether its node was taken for ready before it listened to them."""

    enabled = False
    timers = ()

    def __init__(self) -> None:
        self.ready: list[bool] = []

    @property
    def inputs(self) -> list[Input]:
        self.ready.append(advertised(rospy.resolve_name("~done")))
        return [Input(f"/host/{name}", Header, lambda _message: None, lambda _reason: None, BUFFER_BYTES) for name in ("first", "second")]

    def switch(self, enabled: bool) -> None: ...  # noqa: FBT001 -- a callback's signature


def test_a_node_is_ready_for_lockstep_when_it_listens_to_all_its_inputs(ros_master: str) -> None:
    core, heard = Core(), []
    host = RosHost([], "perception")
    host.done(1)  # nobody may take the node for ready because of it
    host.run(core)
    assert core.ready == [False]
    done = rospy.Subscriber("~done", Header, lambda message: heard.append(message.stamp.to_nsec()))
    until(done.get_num_connections, what="the node is ready")
    assert host.published("/host/second") is False

    def told() -> bool:  # again and again: the publisher learns of a subscriber after the subscriber of it
        host.done(2)
        return bool(heard)

    until(told, what="the measurement is dealt with")
    assert set(heard) == {2}
    done.unregister()
