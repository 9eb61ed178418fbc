"""A counterexample's world over rclpy, in a DDS domain of its own; as a process it plays them (``alula_testing.live_counterexample``)."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from rclpy.parameter import Parameter
from rclpy.time import Time
from rosgraph_msgs.msg import Clock
from skillset_interfaces import action

from alula.common.network import claim_domain
from alula.model.model import Skillset
from alula.prove.skillset.play_world import Hooks
from alula_testing.live_counterexample import LiveWorld, interfaces_of, serve
from skillset_ros2.middleware import RclpyMiddleware
from skillset_ros2.session import Session


@contextmanager
def ros2_world(skillset: Skillset, hooks: Hooks) -> Iterator[LiveWorld]:
    """Serve a skillset over rclpy: a node of the managers and one of the client, each spun by a thread."""
    claim = claim_domain()
    sessions = [Session(f"counterexample_{side}", domain=claim.domain) for side in ("managers", "client")]
    try:
        for session in sessions:
            session.node.set_parameters([Parameter("use_sim_time", value=True)])
        interfaces = interfaces_of(skillset, action, ("",))
        serving, calling = (RclpyMiddleware(session.node, skillset.name, interfaces=interfaces) for session in sessions)
        clock = sessions[1].node.create_publisher(Clock, "/clock", 1)
        tell_time = lambda now_ns: clock.publish(Clock(clock=Time(nanoseconds=now_ns).to_msg()))  # noqa: E731
        world = LiveWorld(serving, calling, tell_time, skillset, hooks)
        calling.prepare_calls()
        try:
            yield world
        finally:
            world.close()
    finally:
        for session in sessions:
            session.close()
        claim.release()


if __name__ == "__main__":
    serve(ros2_world)
