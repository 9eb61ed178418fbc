"""The main function of a skillset's process in ROS 1."""

from __future__ import annotations

import signal
import sys
from types import FrameType, ModuleType

import rosgraph
import rospy

from alula.common.signals import StopEvent
from alula.model.model import Skillset
from alula.runtime.core.errors import SkillRuntimeError
from alula.runtime.managers import DataBindings
from skillset_ros1.managers import HooksFactory, SkillsetManagers, check_alone

CHECK_S = 0.5
REFUSED = 2


def run_skillset(
    skillset: Skillset, interfaces: ModuleType, hooks_factory: HooksFactory, *, data_bindings: DataBindings | None = None
) -> None:
    """Serve a skillset until SIGINT, SIGTERM or the node's end; then stop what runs, report that to its callers, and return.

    Exits with 2 when managers of the skillset are there already.
    The command line is rospy's: ``__ns:=/robot1 __name:=...`` and remappings.
    """
    stop = StopEvent()

    def on_signal(number: int, frame: FrameType | None) -> None:  # noqa: ARG001
        stop.set()

    # Before this node is one: a node of the same name would end the other.
    try:
        check_alone(f"{rosgraph.names.get_ros_namespace(argv=sys.argv)}{skillset.name}")
    except SkillRuntimeError as error:
        sys.stderr.write(f"{error}\n")
        sys.exit(REFUSED)
    # Our own handlers: rospy's would close the connections before the callers had their results.
    rospy.init_node(skillset.name, disable_signals=True)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, on_signal)
    managers = SkillsetManagers(skillset, interfaces, hooks_factory, data_bindings=data_bindings)
    while not stop.wait(CHECK_S) and not rospy.is_shutdown():
        pass
    managers.close("the managers were shut down")
    rospy.signal_shutdown("the managers were shut down")
