"""What the radio is like in each quality, both ways. Where the numbers come from: README.md of the package."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from radio_link.channel import Condition


class Quality(Enum):
    """How good the radio is, the best first. World files know the first three."""

    GOOD = "good"
    DEGRADED = "degraded"
    CRITICAL = "critical"
    OUT = "out"

    @property
    def rank(self) -> int:
        """Position in the order from best (0) to worst."""
        return list(Quality).index(self)


@dataclass(frozen=True)
class Both:
    """Conditions from the drone to the ground (``down``) and from the ground to the drone (``up``)."""

    down: Condition
    up: Condition


PRESETS: dict[Quality, Both] = {
    Quality.GOOD: Both(
        down=Condition(rate_bps=4e6, queue_s=1.0, delay_s=0.025, jitter_s=0.003, loss=0.001),
        up=Condition(rate_bps=1e6, delay_s=0.025, jitter_s=0.003, loss=0.001),
    ),
    Quality.DEGRADED: Both(
        down=Condition(rate_bps=600e3, queue_s=1.0, delay_s=0.05, jitter_s=0.01, loss=0.005, burst_loss=0.3, to_bad=0.01, to_good=0.25),
        up=Condition(rate_bps=128e3, delay_s=0.05, jitter_s=0.01, loss=0.005, burst_loss=0.3, to_bad=0.01, to_good=0.25),
    ),
    Quality.CRITICAL: Both(
        down=Condition(rate_bps=50e3, queue_s=1.0, delay_s=0.1, jitter_s=0.03, loss=0.05, burst_loss=0.6, to_bad=0.05, to_good=0.15),
        up=Condition(rate_bps=32e3, delay_s=0.1, jitter_s=0.03, loss=0.05, burst_loss=0.6, to_bad=0.05, to_good=0.15),
    ),
    Quality.OUT: Both(down=Condition(rate_bps=0.0), up=Condition(rate_bps=0.0)),
}
