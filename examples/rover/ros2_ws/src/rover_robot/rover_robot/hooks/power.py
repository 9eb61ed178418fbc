"""The hooks of the skillset `power`."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

from power_managers.hooks import AbstractChargeSkill, AbstractSupplySkill
from sensor_msgs.msg import BatteryState
from skillset_ros2 import Watch

if TYPE_CHECKING:
    from alula import Execution, SkillHooks
    from power_managers.inputs import ChargeInputs
    from rclpy.node import Node

WINDOW_S = 10.0
FALLS_FAST = 0.004
"""Of the charge, a second: driving takes a tenth of that."""
RESERVE, HOME_S = 0.15, 45.0
"""What is to be left at the dock (the model's 15 %), and how long the way there takes from anywhere."""
NO_RISE_S = 30.0


class Battery:
    """What was told of the battery within the last ten seconds."""

    def __init__(self, node: Node, watch: Watch) -> None:
        self.watch = watch
        self._told: deque[tuple[float, float]] = deque()
        node.create_subscription(BatteryState, "battery_state", self._on_state, 5)

    @property
    def level(self) -> float | None:
        """How full it is, 0 to 1; None: not told."""
        return self._told[-1][1] if self._told else None

    def falling(self, since_s: float) -> float:
        """Return how fast it falls, 1/s, by what was told after a time; 0 when that is not known for long enough."""
        told = [one for one in self._told if one[0] >= since_s]
        lasted_s = told[-1][0] - told[0][0] if told else 0.0
        return (told[0][1] - told[-1][1]) / lasted_s if lasted_s > WINDOW_S / 2.0 else 0.0

    def _on_state(self, message: BatteryState) -> None:
        now_s = self.watch.now_s
        self._told.append((now_s, message.percentage))
        while self._told[0][0] < now_s - WINDOW_S:
            self._told.popleft()


class Supply(AbstractSupplySkill):
    """Runs until the battery is low, which the model says, or falls so fast that it has to turn back by now."""

    def __init__(self, battery: Battery) -> None:
        self._battery = battery
        self._execution: Execution | None = None
        self._since_s = 0.0
        battery.watch.every(self._look, lambda: self._execution is not None)

    def on_dispatch(self, execution: Execution) -> None:
        """Begin."""
        self._since_s, self._execution = self._battery.watch.now_s, execution
        self._battery.watch.wake()

    def on_interrupt(self, execution: Execution) -> None:
        """End."""
        if execution is self._execution:
            self._execution = None

    def progress(self, execution: Execution) -> float:
        """Return how full the battery is."""
        return self._battery.level or 0.0

    def _look(self) -> None:
        execution, falling = self._execution, self._battery.falling(self._since_s)
        level = self._battery.level or 0.0
        if execution is not None and falling > FALLS_FAST and level - falling * HOME_S < RESERVE:
            self._execution = None
            self.terminated_FAILING(execution, f"{100.0 * level:.0f} % are left, and it falls by {100.0 * falling:.1f} % a second")


class Charge(AbstractChargeSkill):
    """Runs until the battery is full enough."""

    def __init__(self, battery: Battery) -> None:
        self._battery = battery
        self._execution: Execution | None = None
        self._best, self._best_s = 0.0, 0.0
        battery.watch.every(self._look, lambda: self._execution is not None)

    def validate(self, inputs: ChargeInputs) -> str:
        """Refuse what can't be reached."""
        return "" if 0.0 < inputs.level <= 1.0 else f"the level is {inputs.level:g}, it should be within 0 and 1"

    def on_dispatch(self, execution: Execution) -> None:
        """Begin."""
        self._best, self._best_s = self._battery.level or 0.0, self._battery.watch.now_s
        self._execution = execution
        self._battery.watch.wake()

    def on_interrupt(self, execution: Execution) -> None:
        """End."""
        if execution is self._execution:
            self._execution = None

    def progress(self, execution: Execution) -> float:
        """Return the part of the wanted level that is there."""
        wanted: float = execution.inputs.level
        return min((self._battery.level or 0.0) / wanted, 1.0)

    def _look(self) -> None:
        execution, level, now_s = self._execution, self._battery.level or 0.0, self._battery.watch.now_s
        if execution is None:
            return
        if level > self._best:
            self._best, self._best_s = level, now_s
        if level >= execution.inputs.level:
            self._execution = None
            self.terminated_CHARGED(execution)
        elif now_s - self._best_s > NO_RISE_S:
            self._execution = None
            self.terminated_NOT_CHARGING(execution, f"{100.0 * level:.0f} %, and no more for {NO_RISE_S:g} s")


def make_hooks(node: Node) -> dict[str, SkillHooks]:
    """Make the hooks of all skills."""
    battery = Battery(node, Watch(node))
    return {"supply": Supply(battery), "charge": Charge(battery)}
