"""The rospy part: a worker thread between the hardware's node and the skillset's manager."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable

import rospy
from skillset_interfaces.msg import ResourceState, ResourceStates
from skillset_interfaces.srv import Transition, TransitionRequest

from resource_reporter.beats import Beats
from resource_reporter.caller import CallFailedError, ServiceCaller
from resource_reporter.calls import publisher, tell_call
from resource_reporter.failing import ends_the_node
from resource_reporter.ledger import Call, Ledger

# A latched topic may have been missed only while its publisher was away: nothing has to be polled. This bounds one wait.
LONGEST_WAIT_S = 1.0
# Of each clock by which managers may count a `silence`.
HEARTBEAT_S = 0.5
# What waits for the skillset to know waits no longer than this (wall clock): a skillset that hangs must stop nothing.
SETTLE_LIMIT_S = 10.0


class ResourceReporter:
    """Report to a skillset the states of resources that only the hardware has (its extern transitions).

    To be made after ``rospy.init_node``. ``report`` may be called from any thread, as often as one likes, and never blocks: the
    service is called by a thread of its own, at once, and until ``/<skillset>/resource_states`` agrees with what was reported last.
    An error in that thread ends the node, with exit code 1.

    Twice a second, by the monotonic clock and by simulated time, it says on ``/<skillset>/reported`` what it reports: its heartbeat. Where
    the model gives a resource a ``silence``, the managers take it for unknown when that is not heard any more.
    """

    def __init__(self, skillset: str) -> None:
        self._skillset = skillset
        self._ledger = Ledger()
        self._changed = threading.Condition()
        self._ended = self._over = False
        self._when_settled: list[Callable[[], None]] = []
        self._unsettled_since_s: float | None = None
        self._told_unknown: set[str] = set()
        publisher()
        self._caller = ServiceCaller(f"/{skillset}/transition", Transition)
        self._worker = threading.Thread(target=self._work, name=f"report_{skillset}", daemon=True)
        self._worker.start()
        self._heartbeat = rospy.Publisher(f"/{skillset}/reported", ResourceStates, queue_size=1, latch=True, tcp_nodelay=True)
        self._beats = Beats(f"beat_{skillset}", HEARTBEAT_S, self._beat)
        self._subscriber = rospy.Subscriber(f"/{skillset}/resource_states", ResourceStates, self._on_states, tcp_nodelay=True)

    def report(self, resource: str, state: str, reason: str = "", *, insist: bool = True) -> None:
        """Report the state of a resource, and the reason in words where it is known.

        Without ``insist`` nothing is to change: the reason is reported where the skillset has that state already.
        """
        with self._changed:
            if self._ledger.want(resource, state, reason, insist=insist):
                self._changed.notify()

    def when_settled(self, job: Callable[[], None]) -> None:
        """Run a job once the skillset has all states reported so far: at once if it does, else in the reporter's thread.

        It knows what it shows, has accepted or has refused. A job waits for 10 s (wall clock) at most, and not at all where nothing shows
        the skillset's states, or the reporter is closed. Jobs are done in the order given.
        """
        with self._changed:
            if not self._over and (self._when_settled or not self._settled()):
                self._when_settled.append(job)
                self._changed.notify()
                return
        job()

    def knows(self) -> bool:
        """Return whether the skillset has all states reported so far: it shows, has accepted or has refused them."""
        with self._changed:
            return self._ledger.settled

    def close(self) -> None:
        """End the worker and drop the connections."""
        with self._changed:  # first: who comes from now on asks no subscriber any more
            self._ended = True
            self._changed.notify()
        self._subscriber.unregister()
        self._beats.close()
        self._heartbeat.unregister()
        self._caller.close()
        self._worker.join(LONGEST_WAIT_S)

    @ends_the_node
    def _beat(self) -> None:
        with self._changed:
            wanted = self._ledger.wanted
        if not wanted or self._ended:
            return
        message = ResourceStates(skillset=self._skillset, resources=[ResourceState(name=one, state=state) for one, state in wanted.items()])
        message.header.stamp = rospy.Time.now()
        with contextlib.suppress(rospy.ROSException):  # at the end of the node the topic is closed first
            self._heartbeat.publish(message)

    @ends_the_node
    def _on_states(self, message: ResourceStates) -> None:
        with self._changed:
            shown = message.resources
            self._ledger.observe({one.name: one.state for one in shown}, {one.name: one.reason for one in shown})
            for name in set(self._ledger.unknown()) - self._told_unknown:
                self._told_unknown.add(name)
                rospy.logerr("the skillset %s has no resource %s", self._skillset, name)
            self._changed.notify()

    @ends_the_node
    def _work(self) -> None:
        while (call := self._next_call()) is not None:
            self._make(call)
        with self._changed:
            self._do_settled()
            self._over = True

    def _settled(self) -> bool:
        if self._ended or self._ledger.settled or not self._subscriber.get_num_connections():  # at the end it hears nothing any more
            self._unsettled_since_s = None
            return True
        now_s = time.monotonic()
        if self._unsettled_since_s is None:
            self._unsettled_since_s = now_s
        return now_s - self._unsettled_since_s >= SETTLE_LIMIT_S

    def _do_settled(self) -> None:
        """Do what has waited, in the reporter's thread and under its lock: what comes meanwhile comes after it."""
        for job in self._when_settled:
            job()
        self._when_settled.clear()

    def _next_call(self) -> Call | None:
        """Wait for the next transition to ask for; None at the end."""
        with self._changed:
            while not self._ended and not rospy.is_shutdown():
                if self._when_settled and self._settled():
                    self._do_settled()
                now_s = time.monotonic()
                call = self._ledger.next_call(now_s)
                if call is not None:
                    return call
                wait_s = self._ledger.wait_s(now_s)
                self._changed.wait(LONGEST_WAIT_S if wait_s is None else min(wait_s, LONGEST_WAIT_S))
            return None

    def _make(self, call: Call) -> None:
        """Make one call, outside the lock, and note its answer."""
        service, begin_s = self._caller.name, rospy.get_time()
        request = TransitionRequest(call.resource, call.to, call.reason)
        try:
            answer = self._caller.call(request)
        except CallFailedError as error:
            tell_call(service, request, None, begin_s, str(error))
            self._note_refusal(call, str(error), answered=False)
            return
        tell_call(service, request, answer, begin_s)
        if answer.accepted or answer.state == call.to:  # refused there: it had that state already
            with self._changed:
                self._ledger.reached(call, time.monotonic())
            return
        self._note_refusal(call, answer.reason)

    def _note_refusal(self, call: Call, reason: str, *, answered: bool = True) -> None:
        with self._changed:
            first = self._ledger.refused(call, reason, time.monotonic(), answered=answered)
        if first and not rospy.is_shutdown():
            rospy.logwarn("%s.%s -> %s: %s; will be tried again", self._skillset, call.resource, call.to, reason)
