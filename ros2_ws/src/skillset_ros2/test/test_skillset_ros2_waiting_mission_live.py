"""A mission that waits for its robot: it looks seldom, hears of each event at once, and ticks at 10 Hz from its begin on."""

from __future__ import annotations

import signal

import pytest

rclpy = pytest.importorskip("rclpy")

from py_trees.behaviour import Behaviour  # noqa: E402
from py_trees.common import Status  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402

from alula.missions.conditions import Condition  # noqa: E402
from alula.missions.context import MissionContext  # noqa: E402
from alula.missions.director import Outcome  # noqa: E402
from alula.missions.driver import TICK_PERIOD_S  # noqa: E402
from alula.missions.pending import PendingInterrupts  # noqa: E402
from alula.missions.plan import MissionPlan  # noqa: E402
from skillset_ros2.mission_node import WAITING_PERIOD_S, MissionNode, tick_to_the_end  # noqa: E402

LOOKS, TICKS = 4, 3


class Root(Behaviour):
    """Notes at which period it is ticked."""

    def __init__(self) -> None:
        super().__init__("root")
        self.node: MissionNode
        self.periods_s: list[float] = []

    def update(self) -> Status:
        self.periods_s.append(period_s(self.node))
        return Status.RUNNING if len(self.periods_s) < TICKS else Status.SUCCESS


class Waiting:
    """A mission that may begin once it has looked ``looks`` times."""

    degraded = stopping = False

    def __init__(self, looks: float) -> None:
        self.root = Root()
        self.looks = looks
        self._asked_ns: list[int] = []
        self._clock_ns = None

    def make(self, _clients, clock_ns, _values):
        self._clock_ns = clock_ns
        return self, MissionContext(clock_ns=clock_ns, pending=PendingInterrupts(clock_ns), entries=dict)

    @property
    def stamps_ns(self) -> list[int]:
        """When it looked; each look asks twice, for the record and to begin."""
        return self._asked_ns[::2]

    def conditions(self):
        self._asked_ns.append(self._clock_ns())
        return [Condition("the robot is there", "" if len(self._asked_ns) >= 2 * self.looks else "it is not")]

    def stop_here(self):
        return Root()


def period_s(node: MissionNode) -> float:
    """Return the period of the node's only timer that ticks the mission."""
    (timer,) = (timer for timer in node.timers if timer.callback == node.driver.wake)
    return timer.timer_period_ns / 1e9


@pytest.fixture
def begun(ros2_domain, tmp_path):
    nodes: list[MissionNode] = []

    def begin(mission: Waiting) -> MissionNode:
        nodes.append(MissionNode(tmp_path, MissionPlan("patrol", (), mission.make)))
        mission.root.node = nodes[0]
        return nodes[0]

    yield begin
    for node in nodes:
        node.destroy_node()


def test_a_mission_looks_seldom_until_it_begins_and_ticks_often_from_then_on(begun):
    mission = Waiting(LOOKS)
    node = begun(mission)
    assert period_s(node) == node.period_s == WAITING_PERIOD_S
    end = tick_to_the_end(node, [])
    assert end.outcome is Outcome.ACCOMPLISHED
    # The first look may be late by up to a period, and the next one is in time again.
    assert mission.stamps_ns[LOOKS - 1] - mission.stamps_ns[0] >= (LOOKS - 2) * WAITING_PERIOD_S * 1e9
    assert mission.root.periods_s == [TICK_PERIOD_S] * TICKS
    assert node.period_s == TICK_PERIOD_S


def test_a_waiting_mission_looks_after_each_event_and_not_between(begun):
    mission = Waiting(2)
    node = begun(mission)
    node.turn()
    assert mission.stamps_ns == []
    mission.looks = 1
    node.driver.wake()
    node.turn()
    assert (len(mission.stamps_ns), node.driver.director.start_s is not None) == (1, True)
    assert period_s(node) == TICK_PERIOD_S


def test_a_mission_that_does_not_begin_ends_as_it_is_told_to(begun):
    mission = Waiting(float("inf"))
    node = begun(mission)
    end = tick_to_the_end(node, [signal.SIGTERM])
    assert (end.outcome, end.reason) == (Outcome.ABORTED, "told to end by SIGTERM")
    assert node.period_s == TICK_PERIOD_S


def test_simulators_are_told_how_far_they_may_go_while_the_mission_waits_as_afterwards(begun):
    node = begun(Waiting(float("inf")))
    node.set_parameters([Parameter("use_sim_time", value=True)])
    assert node.period_s == TICK_PERIOD_S
