"""A ROS 1 node for the tests of bridged actions, in a process of its own: takes commands as JSON lines, reports events as JSON lines."""

import os
import threading

import actionlib
import rospy
from actionlib_msgs.msg import GoalID, GoalStatus
from bridge_test_interfaces.msg import CountAction, CountFeedback, CountGoal, CountResult
from genpy.dynamic import generate_dynamic
from ros_bridge_peer_loop import report, run

KEEP = []
CLIENTS = {}
HANDLES = {}
FINISH = threading.Event()


def run_goal(handle, cancelled):
    """Do as the goal's behaviour says: count, held (ends when told), hang (until cancelled), stubborn (never cancelled), abort, reject."""
    goal = handle.get_goal()
    name = handle.get_goal_id().id
    report(event="goal", id=name, target=goal.target, behaviour=goal.behaviour)
    if goal.behaviour == "reject":
        handle.set_rejected(CountResult(), "not today")
        return
    if goal.behaviour == "silent":
        return
    handle.set_accepted()
    counted = []
    while len(counted) < goal.target or goal.behaviour == "hang":
        if cancelled.wait(goal.period_s) and goal.behaviour != "stubborn":
            report(event="cancelled", id=name)
            handle.set_canceled(CountResult(counted, "cancelled"), "as you wish")
            return
        if goal.behaviour != "hang":
            counted.append(len(counted) + 1)
            handle.publish_feedback(CountFeedback(counted[-1], counted[-1] / goal.target))
    if goal.behaviour == "held":
        FINISH.wait()
        FINISH.clear()
    if goal.behaviour == "abort":
        handle.set_aborted(CountResult(counted, "aborted"), "broken")
    else:
        handle.set_succeeded(CountResult(counted, "from ROS 1"), "well done")


def serve(name):
    """Run each goal in a thread of its own."""
    cancelled = {}

    def on_goal(handle):
        event = cancelled.setdefault(handle.get_goal_id().id, threading.Event())
        threading.Thread(target=run_goal, args=(handle, event), daemon=True).start()

    server = actionlib.ActionServer(name, CountAction, on_goal, lambda handle: cancelled[handle.get_goal_id().id].set(), auto_start=False)
    KEEP.append(server)
    server.start()
    report(event="serving", name=name)


def serve_simple(name):
    """Run one goal at a time; a newer one preempts it."""

    preempted = threading.Event()

    def execute(goal):
        report(event="goal", target=goal.target)
        if goal.behaviour == "hang":
            preempted.wait()
        if server.is_preempt_requested():
            preempted.clear()
            server.set_preempted(CountResult([], "preempted"))
        else:
            server.set_succeeded(CountResult([goal.target], "from ROS 1"))

    server = actionlib.SimpleActionServer(name, CountAction, execute, auto_start=False)
    server.register_preempt_callback(preempted.set)
    KEEP.append(server)
    server.start()
    report(event="serving", name=name)


OLD_PARTS = {"Goal": "int32 target", "Result": "string message\nint32[] counted", "Feedback": "int32 count"}
COMMON = {"std_msgs/Header": "uint32 seq\ntime stamp\nstring frame_id"}
COMMON |= {kind._type: kind._full_text.split("=" * 80)[0] for kind in (GoalID, GoalStatus)}


def old_action():
    """Return the class of an older version of the action, in which parts have fewer fields or another order."""
    package = "bridge_test_interfaces"
    texts = dict(COMMON)
    for part, text in OLD_PARTS.items():
        inner = "GoalID goal_id" if part == "Goal" else "GoalStatus status"
        texts[f"{package}/Count{part}"] = text
        texts[f"{package}/CountAction{part}"] = f"Header header\nactionlib_msgs/{inner}\nCount{part} {part.lower()}"
    whole = "\n".join(f"CountAction{part} action_{part.lower()}" for part in OLD_PARTS)
    parts = "".join(f"\n{'=' * 80}\nMSG: {name}\n{text}" for name, text in texts.items())
    return generate_dynamic(f"{package}/CountAction", whole + parts)[f"{package}/CountAction"]


def serve_old(name):
    """Serve an older version of the action."""
    action = old_action()
    result_class, feedback_class = type(action().action_result.result), type(action().action_feedback.feedback)

    def on_goal(handle):
        handle.set_accepted()
        handle.publish_feedback(feedback_class(handle.get_goal().target))
        handle.set_succeeded(result_class("from old times", [handle.get_goal().target]))

    KEEP.append(actionlib.ActionServer(name, action, on_goal, auto_start=False))
    KEEP[-1].start()
    report(event="serving", name=name)


def client(name):
    """Connect to a server."""
    CLIENTS[name] = actionlib.ActionClient(name, CountAction)
    report(event="connected", found=CLIENTS[name].wait_for_server(rospy.Duration(10.0)))


def goal(name, key, **fields):
    """Send a goal; its transitions and feedbacks are reported under the key."""

    def on_transition(handle):
        state = actionlib.CommState.to_string(handle.get_comm_state())
        event = {"event": "transition", "key": key, "state": state, "status": handle.get_goal_status()}
        if handle.get_comm_state() == actionlib.CommState.DONE:
            result = handle.get_result()
            event["terminal"] = actionlib.TerminalState.to_string(handle.get_terminal_state())
            event["text"] = handle.get_goal_status_text()
            event["counted"] = None if result is None else list(result.counted)
            event["message"] = None if result is None else result.message
        report(**event)

    def on_feedback(_handle, feedback):
        report(event="feedback", key=key, count=feedback.count, fraction=feedback.fraction)

    HANDLES[key] = CLIENTS[name].send_goal(CountGoal(**fields), on_transition, on_feedback)
    stamp = HANDLES[key].comm_state_machine.action_goal.goal_id.stamp
    report(event="sent", key=key, stamp_ns=stamp.to_nsec())


def cancel(key):
    """Cancel one goal."""
    HANDLES[key].cancel()


def cancel_all(name):
    """Cancel all goals of a server."""
    CLIENTS[name].cancel_all_goals()


def cancel_before(name, stamp_ns):
    """Cancel what was stamped at or before a time."""
    CLIENTS[name].pub_cancel.publish(GoalID(stamp=rospy.Time(0, stamp_ns), id=""))


def cancel_id(name, goal_id):
    """Cancel a goal by its name, whether it is there or not."""
    CLIENTS[name].pub_cancel.publish(GoalID(stamp=rospy.Time(), id=goal_id))


def leave():
    """Tell the master of the end, as nodes do that are not killed."""
    rospy.signal_shutdown("that was all")
    os._exit(0)


COMMANDS = {
    "finish": FINISH.set,
    "leave": leave,
    "serve": serve,
    "serve_simple": serve_simple,
    "serve_old": serve_old,
    "client": client,
    "goal": goal,
    "cancel": cancel,
    "cancel_all": cancel_all,
    "cancel_before": cancel_before,
    "cancel_id": cancel_id,
}


run("bridge_action_peer", COMMANDS)
