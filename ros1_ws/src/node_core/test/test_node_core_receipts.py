"""What a reader says that it has taken, on a live graph: what waits for it, and what does not."""

from __future__ import annotations

import rospy
from std_msgs.msg import Header

from alula_testing.waits import until
from node_core.ros.receipts import Receipts


def header(stamp_ns: int, name: str = "~verdict") -> Header:
    return Header(stamp=rospy.Time(nsecs=stamp_ns), frame_id=rospy.resolve_name(name))


def test_what_waits_is_done_when_the_reader_has_taken_what_was_sent(ros_master: str) -> None:
    done: list[int] = []
    receipts = Receipts("/reader/taken", "~verdict")

    def dealt_with(stamp_ns: int) -> bool:
        receipts.sent(stamp_ns)
        receipts.when_settled(lambda: done.append(stamp_ns))
        return stamp_ns in done

    assert dealt_with(1), "nobody says what it takes"
    reader = rospy.Publisher("/reader/taken", Header, queue_size=10, tcp_nodelay=True)
    until(reader.get_num_connections, what="the node hears the reader")
    until(lambda: not dealt_with(2), what="the node waits for the reader")
    done.clear()
    reader.publish(header(2, "/another/verdict"))
    reader.publish(header(1))
    reader.publish(header(2))
    until(lambda: bool(done), what="the reader has taken it")
    assert set(done) == {2}
    assert not dealt_with(3)
    reader.publish(header(2))  # late: the one before
    assert not dealt_with(4)
    reader.publish(header(4))
    until(lambda: 4 in done, what="the reader has taken the last one")
    assert done[-2:] == [3, 4], "in the order given"
    assert not dealt_with(5)
    reader.unregister()
    until(lambda: 5 in done, what="a reader that has gone is not waited for")
