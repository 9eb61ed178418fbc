"""What crosses of an action, without ROS: actionlib's bytes against genpy's own, and the goals' tables under any sequence of events."""

import contextlib
import struct
import uuid

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ros_bridge import actionlib_wire
from ros_bridge.action_states import ROS1_TERMINAL, ROS2_TERMINAL, TO_ROS1, TO_ROS2, CancelCode, Ros1Status, Ros2Status
from ros_bridge.action_types import action_type
from ros_bridge.actionlib_wire import GoalId, GoalStatus
from ros_bridge.conversion import Types, ament_prefixes
from ros_bridge.definitions import split
from ros_bridge.errors import TypeUnknownError, WireError
from ros_bridge.goals_to_ros1 import (
    AFTER_CANCEL_S,
    ANY_GOAL,
    KEEP_RESULT_BYTES,
    KEEP_RESULT_S,
    KEEP_RESULTS,
    LATE_RESULT_WITHIN_S,
    QUEUED_S,
    RESULT_WITHIN_S,
    GoalsToRos1,
)
from ros_bridge.goals_to_ros2 import GoalsToRos2

LAST_NS = 0xFFFFFFFF * 1_000_000_000
goal_ids = st.builds(GoalId, st.text(max_size=20), st.integers(0, LAST_NS))
goal_statuses = st.builds(GoalStatus, goal_ids, st.sampled_from(Ros1Status), st.text(max_size=20))


def test_goal_status_byte_for_byte():
    message = actionlib_wire.encode_status_array(
        [GoalStatus(GoalId("ab", 3_000_000_004), Ros1Status.ABORTED, "c")], seq=7, stamp_ns=1_000_000_002
    )
    assert message == (
        struct.pack("<III", 7, 1, 2)  # header: seq, secs, nsecs
        + struct.pack("<I", 0)  # header: frame_id
        + struct.pack("<I", 1)  # one status
        + struct.pack("<II", 3, 4)  # goal_id.stamp
        + struct.pack("<I", 2)
        + b"ab"  # goal_id.id
        + bytes([4])  # status
        + struct.pack("<I", 1)
        + b"c"  # text
    )


@given(st.lists(goal_statuses, max_size=4))
def test_status_array_round_trip(statuses):
    assert actionlib_wire.decode_status_array(actionlib_wire.encode_status_array(statuses, seq=1, stamp_ns=5)) == statuses


@given(goal_ids, goal_statuses, st.binary(max_size=50))
def test_goals_and_outcomes_round_trip(goal_id, status, payload):
    assert actionlib_wire.decode_goal(actionlib_wire.encode_goal(goal_id, payload, seq=1, stamp_ns=5)) == (goal_id, payload)
    assert actionlib_wire.decode_outcome(actionlib_wire.encode_outcome(status, payload, seq=1, stamp_ns=5)) == (status, payload)
    assert actionlib_wire.decode_goal_id(actionlib_wire.encode_goal_id(goal_id)) == goal_id


@given(st.binary(max_size=120))
def test_any_bytes_are_read_or_refused(data):
    for decode in (
        actionlib_wire.decode_status_array,
        actionlib_wire.decode_goal,
        actionlib_wire.decode_outcome,
        actionlib_wire.decode_goal_id,
    ):
        with contextlib.suppress(WireError):
            decode(data)


def test_every_state_has_its_counterpart():
    assert set(TO_ROS2) == set(Ros1Status)
    assert set(TO_ROS1) == set(Ros2Status)
    assert all(TO_ROS2[status] in ROS2_TERMINAL for status in ROS1_TERMINAL)
    assert all(TO_ROS1[status] in ROS1_TERMINAL for status in ROS2_TERMINAL)


def test_md5_sums_of_an_action_are_those_of_genpy():
    action = action_type(Types(ament_prefixes()), "bridge_test_interfaces/Count", "bridge_test_interfaces/Count")
    sums = [part.envelope.md5sum for part in (action.goal, action.result, action.feedback)]
    assert sums == ["c6c96f7e707cf908bb40bcffeedb2718", "a764b76e26d05d07b931699d7af9ec18", "7030176b9408030ce098804e78467d2b"]
    assert action.result.envelope.ros1_name == "bridge_test_interfaces/CountActionResult"


def test_unknown_action_type_is_named_with_the_place_and_the_remedy():
    with pytest.raises(TypeUnknownError, match=r"no_msgs/action/No\.action .* build the package"):
        action_type(Types(ament_prefixes()), "no_msgs/No", "no_msgs/No")


def test_split_of_an_action_text():
    assert split("int32 a\n---\n---\nint32 b # c", 3) == ["int32 a", "", "int32 b # c"]


class Server:
    """The server's side of both tables: what was asked of it, and what a test lets it say."""

    def __init__(self) -> None:
        self.here = True
        self.away = False
        self.come = False
        self.goals: list = []
        self.cancelled: list = []
        self.asked: list = []
        self.forgotten: list = []

    def present(self):
        return self.here

    def gone(self):
        return not self.here

    def late(self):
        return self.away

    def has_come(self):
        come, self.come = self.come, False
        return come

    def send_goal(self, goal, payload):
        self.goals.append(goal)

    def send_cancel(self, goal):
        self.cancelled.append(goal)

    def ask_result(self, goal):
        self.asked.append(goal)

    def forget(self, goal):
        self.forgotten.append(goal)


class Clients2:
    def __init__(self) -> None:
        self.answers: dict = {}
        self.results: dict = {}
        self.cancels: list = []
        self.states: dict = {}

    def reply_goal(self, caller, *, accepted, stamp_ns):
        assert caller not in self.answers, "answered twice"
        self.answers[caller] = accepted

    def reply_cancel(self, caller, code, goals):
        self.cancels.append((code, [goal for goal, _ in goals]))

    def reply_result(self, caller, status, payload, reason):
        assert caller not in self.results, "two results"
        self.results[caller] = status

    def publish_feedback(self, goal, payload):
        pass

    def publish_status(self, goals):
        for goal, _, status in goals:
            assert self.states.get(goal) not in ROS2_TERMINAL or self.states[goal] == status, "a terminal state was left"
            self.states[goal] = status


class Clients1:
    def __init__(self) -> None:
        self.results: dict = {}
        self.texts: dict = {}
        self.listed: list = []

    def publish_status(self, statuses):
        self.listed = statuses

    def publish_feedback(self, status, payload):
        pass

    def publish_result(self, status, payload):
        assert status.goal_id.name not in self.results, "two results"
        assert status.status in ROS1_TERMINAL
        self.results[status.goal_id.name] = status.status
        self.texts[status.goal_id.name] = status.text


def goal_uuid(number: int) -> bytes:
    return bytes(15) + bytes([number + 1])


def goal_name(number: int) -> str:
    return f"00000000-0000-0000-0000-0000000000{number + 1:02x}"


goals = st.integers(0, 2)
events_to_ros1 = st.lists(
    st.one_of(
        st.tuples(st.just("goal"), goals),
        st.tuples(st.just("cancel"), goals),
        st.tuples(st.just("ask"), goals),
        st.tuples(st.just("status"), goals, st.sampled_from(Ros1Status)),
        st.tuples(st.just("result"), goals, st.sampled_from(sorted(ROS1_TERMINAL))),
        st.tuples(st.just("tick"), st.sampled_from([0.05, 1.1, 3.0])),
        st.tuples(st.just("here"), st.booleans()),
    ),
    max_size=25,
)


@settings(max_examples=200)
@given(events_to_ros1)
def test_any_course_of_events_answers_each_ros2_client_exactly_once(events):
    server, clients = Server(), Clients2()
    table = GoalsToRos1("test", 5.0)
    table.connect(server, clients)
    now, asked = 0.0, []
    for kind, *what in events:
        match kind:
            case "goal":
                table.request_goal(f"goal {len(asked)} {now}", goal_uuid(what[0]), b"", now)
                asked.append(f"goal {len(asked)} {now}")
            case "cancel":
                table.request_cancel("cancel", goal_uuid(what[0]), 0, now)
            case "ask":
                table.request_result(f"result {len(asked)}", goal_uuid(what[0]))
                asked.append(f"result {len(asked)}")
            case "status":
                table.on_status([GoalStatus(GoalId(goal_name(what[0]), 9), what[1])], now)
            case "result":
                table.on_result(GoalStatus(GoalId(goal_name(what[0]), 9), what[1]), b"", now)
            case "tick":
                now += what[0]
                table.tick(now)
            case "here":
                server.here = what[0]
    server.here = False
    for _ in range(3):
        now += 10.0
        table.tick(now)
    assert not table.busy
    assert {name for name in asked if name.startswith("goal")} == set(clients.answers)
    assert {name for name in asked if name.startswith("result")} == set(clients.results)
    table.tick(now + 100.0)
    assert table._goals == {}


events_to_ros2 = st.lists(
    st.one_of(
        st.tuples(st.just("goal"), goals),
        st.tuples(st.just("cancel"), goals),
        st.tuples(st.just("cancel before"), st.integers(0, 4)),
        st.tuples(st.just("answer"), goals, st.booleans()),
        st.tuples(st.just("status"), goals, st.sampled_from(Ros2Status)),
        st.tuples(st.just("result"), goals, st.sampled_from(Ros2Status)),
        st.tuples(st.just("tick"), st.sampled_from([0.05, 1.1])),
        st.tuples(st.just("here"), st.booleans()),
        st.tuples(st.just("come")),
    ),
    max_size=25,
)


@settings(max_examples=200)
@given(events_to_ros2)
def test_any_course_of_events_gives_each_ros1_client_exactly_one_result(events):
    server, clients = Server(), Clients1()
    table = GoalsToRos2("test", 5.0)
    table.connect(server, clients)
    now, sent = 0.0, set()
    for kind, *what in events:
        if now > 4.0:  # actionlib takes a name again when it has forgotten it
            break
        uuids = [table._goals[f"{number}"].uuid if f"{number}" in table._goals else bytes(16) for number in range(3)]
        match kind:
            case "goal":
                table.on_goal(GoalId(f"{what[0]}", what[0] + 1), b"x", now)
                sent.add(f"{what[0]}")
            case "cancel":
                table.on_cancel(GoalId(f"{what[0]}", 0), now)
            case "cancel before":
                table.on_cancel(GoalId("", what[0]), now)
            case "answer":
                table.on_answer(uuids[what[0]], accepted=what[1], stamp_ns=1, reason="", now_s=now)
            case "status":
                table.on_status([(uuids[what[0]], what[1])], now)
            case "result":
                table.on_result(uuids[what[0]], what[1], b"", "", now)
            case "tick":
                now += what[0]
                table.tick(now)
            case "here":
                server.here = what[0]
            case "come":
                server.come = True
    server.here = False
    table.tick(now + 6.0)
    assert not table.busy
    assert set(clients.results) == sent
    table.tick(now + 20.0)
    assert table._goals == table._by_uuid == {}
    assert clients.listed == []


def to_ros2():
    server, clients = Server(), Clients1()
    table = GoalsToRos2("test", 5.0)
    table.connect(server, clients)
    return table, server, clients


def test_cancel_request_that_overtakes_its_goal_recalls_it():
    table, server, clients = to_ros2()
    table.on_cancel(GoalId("late", 0), 0.0)
    table.on_goal(GoalId("late", 0), b"", 0.1)
    assert clients.results == {"late": Ros1Status.RECALLED}
    assert server.goals == []


def test_cancel_request_with_a_stamp_meets_older_goals_that_come_later():
    table, _, clients = to_ros2()
    table.on_cancel(GoalId("", 10), 0.0)
    table.on_goal(GoalId("old", 10), b"", 0.1)
    table.on_goal(GoalId("new", 11), b"", 0.1)
    assert clients.results == {"old": Ros1Status.RECALLED}


def test_goal_lost_on_the_way_is_sent_again_and_one_that_a_new_server_does_not_know_is_over():
    table, server, clients = to_ros2()
    table.on_goal(GoalId("a", 1), b"", 0.0)
    table.tick(1.5)
    assert len(server.asked) == 1
    table.on_result(server.goals[0], Ros2Status.UNKNOWN, b"", "", 1.6)
    assert server.goals == [server.goals[0]] * 2
    table.on_answer(server.goals[0], accepted=True, stamp_ns=1, reason="", now_s=1.7)
    server.come = True
    table.tick(1.8)
    table.on_result(server.goals[0], Ros2Status.UNKNOWN, b"", "", 1.9)
    assert clients.results == {"a": Ros1Status.ABORTED}
    assert clients.texts == {"a": "the server in ROS 2 does not know the goal: it was restarted"}


def test_goal_that_a_server_has_not_answered_that_goes_is_for_the_one_that_comes_in_time():
    table, server, clients = to_ros2()
    table.on_goal(GoalId("a", 1), b"", 0.0)
    server.here = False
    table.tick(0.5)
    assert clients.results == {}
    server.here = server.come = True
    table.tick(1.0)
    table.on_result(server.goals[0], Ros2Status.UNKNOWN, b"", "", 1.1)
    assert server.goals == [server.goals[0]] * 2
    table.on_answer(server.goals[0], accepted=True, stamp_ns=1, reason="", now_s=1.2)
    server.here = False
    table.tick(1.5)
    assert (clients.results, clients.texts) == ({"a": Ros1Status.ABORTED}, {"a": "the server in ROS 2 is gone"})


def test_goal_that_a_server_has_not_answered_that_goes_ends_when_no_other_comes_or_it_is_cancelled():
    table, server, clients = to_ros2()
    table.on_goal(GoalId("a", 1), b"", 0.0)
    table.on_goal(GoalId("b", 1), b"", 0.0)
    server.here = False
    table.on_cancel(GoalId("b", 0), 0.5)
    table.tick(0.6)
    assert clients.results == {"b": Ros1Status.REJECTED}
    table.tick(5.5)
    assert (clients.results["a"], clients.texts["a"]) == (Ros1Status.REJECTED, "no server in ROS 2")


def test_goal_that_an_actionlib_server_has_not_taken_that_goes_is_for_the_one_that_comes_in_time():
    server, clients = Server(), Clients2()
    table = GoalsToRos1("test", 5.0)
    table.connect(server, clients)
    table.request_goal("goal", goal_uuid(0), b"", 0.0)
    server.here = False
    table.tick(0.5)
    assert clients.answers == {}
    server.here = True
    table.tick(2.0)
    assert server.goals == [goal_name(0)] * 2
    table.on_status([GoalStatus(GoalId(goal_name(0), 9), Ros1Status.ACTIVE)], 2.1)
    assert clients.answers == {"goal": True}


def test_goal_accepted_after_its_client_was_told_no_is_cancelled():
    table, server, clients = to_ros2()
    table.on_goal(GoalId("a", 1), b"", 0.0)
    table.tick(5.5)
    assert clients.results == {"a": Ros1Status.REJECTED}
    table.on_answer(server.goals[0], accepted=True, stamp_ns=1, reason="", now_s=5.6)
    assert server.cancelled == server.goals


def test_restarted_actionlib_server_that_no_longer_lists_a_goal_aborts_it():
    server, clients = Server(), Clients2()
    table = GoalsToRos1("test", 5.0)
    table.connect(server, clients)
    table.request_goal("goal", goal_uuid(0), b"", 0.0)
    table.on_status([GoalStatus(GoalId(goal_name(0), 9), Ros1Status.ACTIVE)], 0.1)
    table.request_result("result", goal_uuid(0))
    table.on_status([], 0.2)
    assert clients.results == {"result": Ros2Status.ABORTED}
    table.request_cancel("cancel", goal_uuid(0), 0, 0.3)
    table.request_cancel("cancel", goal_uuid(5), 0, 0.3)
    assert clients.cancels == [(CancelCode.GOAL_TERMINATED, []), (CancelCode.UNKNOWN_GOAL_ID, [])]


@pytest.mark.parametrize(("away", "within_s"), [(False, RESULT_WITHIN_S), (True, LATE_RESULT_WITHIN_S)])
def test_result_that_does_not_come_is_waited_for_longer_when_the_server_was_away(away, within_s):
    server, clients = Server(), Clients2()
    server.away = away
    table = GoalsToRos1("test", 5.0)
    table.connect(server, clients)
    table.request_goal("goal", goal_uuid(0), b"", 0.0)
    table.on_status([GoalStatus(GoalId(goal_name(0), 9), Ros1Status.SUCCEEDED)], 0.0)
    table.tick(QUEUED_S + 0.1)
    assert clients.answers == {"goal": True}
    table.request_result("result", goal_uuid(0))
    table.tick(within_s)
    assert clients.results == {}
    table.tick(within_s + 0.1)
    assert clients.results == {"result": Ros2Status.SUCCEEDED}


@pytest.mark.parametrize("here", [True, False], ids=["server is there", "server comes"])
def test_a_request_to_cancel_all_reaches_goals_of_others_and_no_goal_that_comes_after_it(here):
    server, clients = Server(), Clients2()
    server.here = here
    table = GoalsToRos1("test", 5.0)
    table.connect(server, clients)
    table.request_cancel("cancel", ANY_GOAL, 0, 0.0)
    assert clients.cancels == [(CancelCode.NONE, [])]
    table.request_goal("goal", goal_uuid(0), b"", 0.01)
    assert (server.cancelled, server.goals) == ([""] if here else [], [])
    server.here = True
    table.tick(0.05)
    assert (server.cancelled, server.goals) == ([""], [])
    table.tick(0.05 + AFTER_CANCEL_S)
    assert (server.cancelled, server.goals) == ([""], [goal_name(0)])
    table.request_cancel("cancel", ANY_GOAL, 7, 0.3)
    assert server.cancelled == [""], "a stamp is of goals that are known here"


def ended_goals(count, size=0):
    """Return a table of goals that have ended one after another, at 0.0 s, 0.01 s and so on, with results of this size."""
    clients = Clients2()
    table = GoalsToRos1("test", 5.0)
    table.connect(Server(), clients)
    for number in range(count):
        name = uuid.UUID(int=number + 1)
        status = GoalStatus(GoalId(str(name), 9), Ros1Status.SUCCEEDED)
        table.request_goal(number, name.bytes, b"", 0.01 * number)
        table.on_result(status, bytes(size), 0.01 * number)
    return table, clients


def kept(table, clients, now_s):
    """Return the numbers of the goals whose results are still known."""
    table.tick(now_s)
    clients.results.clear()
    for number in clients.answers:
        table.request_result(number, uuid.UUID(int=number + 1).bytes)
    return [number for number, status in clients.results.items() if status is Ros2Status.SUCCEEDED]


def test_a_result_can_be_asked_for_until_a_minute_after_the_end():
    table, clients = ended_goals(2)
    assert kept(table, clients, KEEP_RESULT_S) == [0, 1]
    assert kept(table, clients, KEEP_RESULT_S + 0.005) == [1]
    assert kept(table, clients, KEEP_RESULT_S + 1.0) == []


def test_of_too_many_or_too_large_results_the_oldest_are_dropped():
    table, clients = ended_goals(KEEP_RESULTS + 3)
    assert kept(table, clients, 20.0) == list(range(3, KEEP_RESULTS + 3))
    table, clients = ended_goals(3, KEEP_RESULT_BYTES // 2)
    assert kept(table, clients, 1.0) == [1, 2]
    table, clients = ended_goals(2, KEEP_RESULT_BYTES + 1)
    assert kept(table, clients, 1.0) == [1]
