"""How many bits per second the radio takes: found from what the receiver reports. Pure.

Additive-increase, multiplicative-decrease on queueing delay and loss, as delay-based congestion control does it (RFC 8836 names
the requirements, RFC 8298 a relative): down to a part of what has really arrived as soon as the queue grows, up by some percent a
report while it is empty, slowly near the rate at which it last grew. When no report comes, half of it every 0.3 s.
"""

from __future__ import annotations

from dataclasses import dataclass

from video_stream.report import VideoReport
from video_stream.wire import NS


@dataclass(frozen=True, kw_only=True)
class RateSettings:
    """Limits in bits per second and seconds."""

    start_bps: float = 1.5e6
    min_bps: float = 100e3
    relieved_bps: float = 180e3  # once the least was reached: from here on there is something to give again
    max_bps: float = 2.5e6
    queue_limit_s: float = 0.1
    loss_limit: float = 0.2
    decrease: float = 0.8
    most_decrease: float = 0.45  # at once: what has just arrived may be little because little was sent
    most_decrease_queued: float = 0.2  # where packets wait, what arrives is what the radio carries
    hold_s: float = 0.25  # after a decrease, until what it did can be seen
    increase: float = 1.03
    careful_increase: float = 1.006
    silence_s: float = 0.4
    back_off_s: float = 0.3


class RateController:
    """Controls the bit rate to encode at. Call ``on_report`` for each report and ``on_time`` at each frame."""

    def __init__(self, settings: RateSettings | None = None) -> None:
        self._settings = settings or RateSettings()
        self.target_bps = self._settings.start_bps
        self._congested_bps = self._settings.max_bps * 2
        self._held_until_ns = 0
        self._heard_ns: int | None = None
        self.exhausted = False
        """There is nothing more to give: the target fell to the least and has not got away from it."""

    def on_report(self, report: VideoReport, now_ns: int) -> None:
        """Update the rate by a report."""
        limits = self._settings
        self._heard_ns = now_ns
        congested = report.queue_s > limits.queue_limit_s or report.loss > limits.loss_limit
        if congested and now_ns >= self._held_until_ns:
            self._congested_bps = max(report.received_bps, limits.min_bps)
            wanted_bps = min(self.target_bps * 0.9, report.received_bps * limits.decrease)
            queued = report.queue_s > limits.queue_limit_s and report.loss <= limits.loss_limit
            self._set(max(wanted_bps, self.target_bps * (limits.most_decrease_queued if queued else limits.most_decrease)))
            self._held_until_ns = now_ns + int(limits.hold_s * NS)
        elif not congested and now_ns >= self._held_until_ns and report.received_bps > 0.0:
            near = 0.8 * self._congested_bps < self.target_bps < 1.2 * self._congested_bps
            untried = report.received_bps < 0.5 * self.target_bps  # the picture needs less than it may have
            self._set(self.target_bps * (limits.careful_increase if near or untried else limits.increase))

    def on_time(self, now_ns: int) -> None:
        """Back off while no report comes from the receiver; before the first one, keep the rate."""
        limits = self._settings
        if self._heard_ns is None or now_ns - self._heard_ns < limits.silence_s * NS:
            return
        if now_ns >= self._held_until_ns:
            self._set(self.target_bps / 2)
            self._held_until_ns = now_ns + int(limits.back_off_s * NS)

    def _set(self, rate_bps: float) -> None:
        limits = self._settings
        self.target_bps = min(max(rate_bps, limits.min_bps), limits.max_bps)
        self.exhausted = self.target_bps <= limits.min_bps or (self.exhausted and self.target_bps < limits.relieved_bps)
