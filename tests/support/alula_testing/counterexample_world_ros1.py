"""A counterexample's world over rospy, with a master of its own; as a process it plays them (``alula_testing.live_counterexample``)."""

from __future__ import annotations

import functools
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import rosgraph
import rospy
from rosgraph_msgs.msg import Clock
from rosmaster.master import Master
from skillset_interfaces import msg as messages

from alula.model.model import Skillset
from alula.prove.skillset.play_world import Hooks
from alula_testing.live_counterexample import LiveWorld, interfaces_of, serve
from skillset_ros1.middleware import RospyMiddleware
from skillset_ros1.names import place

KINDS = ("Action", "ActionGoal", "ActionResult", "ActionFeedback", "Goal", "Result", "Feedback")


@contextmanager
def ros1_world(skillset: Skillset, hooks: Hooks) -> Iterator[LiveWorld]:
    """Serve a skillset over rospy; managers and client are in this process's node."""
    tell_time = own_graph()
    interfaces = interfaces_of(skillset, messages, KINDS)
    root = place("", skillset.name)
    serving, calling = (RospyMiddleware(skillset.name, root, interfaces) for _ in range(2))
    world = LiveWorld(serving, calling, tell_time, skillset, hooks)
    try:
        yield world
    finally:
        world.close()


@functools.cache
def own_graph() -> Callable[[int], None]:
    """Run a master on loopback and be its node, on simulated time, until the process ends; return what tells the time, ns."""
    os.environ["ROS_IP"] = "127.0.0.1"
    master = Master(port=0)
    master.start()
    os.environ["ROS_MASTER_URI"] = master.uri
    rosgraph.Master("/counterexample").setParam("/use_sim_time", True)
    rospy.init_node("counterexample", disable_signals=True, disable_rosout=True)
    clock = rospy.Publisher("/clock", Clock, queue_size=1)
    return lambda now_ns: clock.publish(Clock(clock=rospy.Time(0, now_ns)))


if __name__ == "__main__":
    serve(ros1_world)
