"""The loop around ROS 2's executor, with real executors: what ends it, and what does not."""

import threading

import pytest
import rclpy
from rclpy.context import Context
from rclpy.exceptions import InvalidHandle
from rclpy.executors import SingleThreadedExecutor
from std_msgs.msg import String

from alula.common.fast_dds import leave
from alula_testing.waits import HANGS_S
from ros_bridge.spinning import spin


class ToldExecutor(SingleThreadedExecutor):
    """Tells when rclpy's own loop has raised InvalidHandle."""

    def __init__(self, context):
        super().__init__(context=context)
        self.raised = threading.Event()

    def spin(self):
        try:
            super().spin()
        except InvalidHandle:
            self.raised.set()
            raise


@pytest.fixture
def world(ros2_domain):
    """Return a node, its executor, and the thread that spins it, in a context of their own."""
    context = Context()
    rclpy.init(context=context)
    executor = ToldExecutor(context)
    node = rclpy.create_node("spinning_test", context=context)
    executor.add_node(node)
    thread = threading.Thread(target=spin, args=(executor,))
    yield node, executor, thread
    executor.shutdown(timeout_sec=0.0)
    thread.join(HANGS_S)
    leave(node)


def works(node):
    """Return whether a callback runs."""
    called = threading.Event()
    timer = node.create_timer(0.01, called.set)
    done = called.wait(HANGS_S)
    node.destroy_timer(timer)
    return done


def test_spinning_goes_on_after_an_end_was_closed_under_the_executor(world, caplog):
    """A part of the subscription is closed and the node still has it: the moment in which another thread is that destroys it."""
    node, executor, thread = world
    subscription = node.create_subscription(String, "/bridge_spinning", print, 1)
    subscription.event_handlers[0].destroy()
    thread.start()
    assert executor.raised.wait(HANGS_S)
    assert thread.is_alive()
    node.destroy_subscription(subscription)
    assert works(node)
    assert not [record for record in caplog.records if record.exc_info]  # no callback has raised


def test_spinning_goes_on_after_a_callback_has_raised(world, caplog):
    node, _, thread = world
    raised = threading.Event()

    def fail():
        raised.set()
        raise ValueError("broken")

    timer = node.create_timer(0.01, fail)
    thread.start()
    assert raised.wait(HANGS_S)
    node.destroy_timer(timer)
    assert works(node)
    assert any(record.exc_info and "broken" in str(record.exc_info[1]) for record in caplog.records)


@pytest.mark.parametrize("what", ["executor", "context"])
def test_spinning_ends_when_the_executor_or_its_context_is_shut_down(world, what):
    node, executor, thread = world
    thread.start()
    assert works(node)
    executor.shutdown() if what == "executor" else node.context.shutdown()
    thread.join(HANGS_S)
    assert not thread.is_alive()
