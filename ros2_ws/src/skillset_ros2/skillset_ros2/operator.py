"""An operator who does what a run asks for: pauses the mission, has it go on, aborts it, over the services that the page uses, too.

usage: python -m skillset_ros2.operator --acts FAULT[,FAULT] --out DIR [--ros-args ...]

A fault is written as after `--fail`: `operator:pause@10-20`, `operator:abort@15`, seconds of mission clock after the departure, which the
record in DIR tells. What was done, and the mission's answer, is noted in the run's log.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import rclpy
from rclpy.node import Node
from rclpy.utilities import remove_ros_args
from std_srvs.srv import SetBool, Trigger

from alula.common.fast_dds import leave
from alula.common.faults import FaultError, parse_faults
from alula.common.operator import ABORT, FAULTS, OPERATOR, PAUSE, Act, acts_of
from alula.common.run_log import note_act
from alula.common.signals import on_end_signal
from alula.records.departure import Departure
from skillset_ros2 import NodeExecutor
from skillset_ros2.mission_clock import NodeClock
from skillset_ros2.simulated_time import SimulatedTime

LOOK_S = 0.05  # mission clock; how late an act may be
TURN_S = 0.1  # wall clock; how soon a signal is seen


class OperatorNode(Node):  # type: ignore[misc]  # rclpy is not typed
    """`/operator`: does each act once, when it is due."""

    def __init__(self, acts: Sequence[Act], out: Path) -> None:
        super().__init__(OPERATOR, start_parameter_services=False)
        self._simulated_time = SimulatedTime(self)
        self._clock_of_mission = NodeClock(self)
        self._left = list(acts)
        self._out = out
        self._departure = Departure(out)
        self._abort = self.create_client(Trigger, "mission/abort")
        self._pause = self.create_client(SetBool, "mission/pause")
        self._clock_of_mission.every(LOOK_S, self._look)

    def _look(self) -> None:
        """Do what is due."""
        departed_s = self._departure.look()
        now_s = self._clock_of_mission.now_ns() / 1e9
        while departed_s is not None and self._left and now_s >= departed_s + self._left[0].since_s:
            self._do(self._left.pop(0), now_s)

    def _do(self, act: Act, now_s: float) -> None:
        if act.command == ABORT:
            answer = self._abort.call_async(Trigger.Request())
        else:
            answer = self._pause.call_async(SetBool.Request(data=act.command == PAUSE))
        answer.add_done_callback(partial(self._note, act, now_s))

    def _note(self, act: Act, now_s: float, answer: Any) -> None:
        note_act(self._out, now_s, {"command": act.command, "by": "--fail", "answer": answer.result().message})

    def destroy_node(self) -> None:
        """Take no more ticks of a simulated clock, and destroy the node."""
        self._simulated_time.close()
        super().destroy_node()


def parse(arguments: Sequence[str]) -> tuple[list[Act], Path]:
    """Return the acts and the run's folder; a wrong command line ends with its usage on stderr and exit code 2."""
    parser = argparse.ArgumentParser(prog=OPERATOR, description="Act as the operator of a run.")
    parser.add_argument("--acts", required=True, help="as after --fail, between commas")
    parser.add_argument("--out", type=Path, required=True, help="the run's folder")
    given = parser.parse_args(arguments)
    try:
        return acts_of(parse_faults(given.acts, FAULTS)), given.out
    except FaultError as error:
        parser.error(str(error))


def main(arguments: Sequence[str] | None = None) -> int:
    """Act until the process receives a signal to end."""
    words = list(sys.argv if arguments is None else arguments)
    acts, out = parse(remove_ros_args(words)[1:])
    ends: list[object] = []
    on_end_signal(ends.append)
    rclpy.init(args=words, signal_handler_options=rclpy.signals.SignalHandlerOptions.NO)
    node = OperatorNode(acts, out)
    executor = NodeExecutor()
    executor.add_node(node)
    while not ends:
        executor.spin_once(timeout_sec=TURN_S)
    leave(node)
    return 0


if __name__ == "__main__":
    sys.exit(main())
