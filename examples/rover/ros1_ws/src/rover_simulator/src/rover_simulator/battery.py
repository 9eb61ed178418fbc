"""The battery: how full it is, and what empties and fills it."""

from __future__ import annotations

START_PERCENT = 80.0
IDLE_PERCENT_S = 0.01
DRIVE_PERCENT_S = 0.05  # at 1 m/s, on top
DRAIN_PERCENT_S = 0.8  # of one that fails
CHARGE_PERCENT_S = 2.0
FULL_V, EMPTY_V = 25.2, 21.0


class Battery:
    """Counts what goes in and out."""

    def __init__(self) -> None:
        self.percent = START_PERCENT
        self.charging = False

    def step(self, period_s: float, speed_m_s: float, *, charging: bool, drains: bool) -> None:
        """Advance by a period."""
        self.charging = charging
        rate = CHARGE_PERCENT_S if charging else -(IDLE_PERCENT_S + DRIVE_PERCENT_S * abs(speed_m_s))
        rate -= DRAIN_PERCENT_S if drains and not charging else 0.0
        self.percent = min(100.0, max(0.0, self.percent + rate * period_s))

    @property
    def volts(self) -> float:
        """Return the voltage, on a straight line between empty and full."""
        return EMPTY_V + (FULL_V - EMPTY_V) * self.percent / 100.0
