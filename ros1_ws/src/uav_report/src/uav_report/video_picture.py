"""``video.svg``: what the telepilot saw, over time: frames per second, quality, delay, and the bits in the room that the radio left."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from alula.report.timeline import Timeline
from uav_report.video import Floats, RadioState, Video

WIDTH_IN, HEIGHT_IN = 11.0, 7.5
SHADES = {"degraded": "#fbe7b6", "critical": "#f2b8ad", "out": "#c9c9c9"}
KILO = 1e-3


def draw_video(video: Video, timeline: Timeline, path: Path, *, title: str) -> None:
    """Draw frame rate, similarity, delay and bit rate over seconds since lift-off, with the radio's state and the marks."""
    figure = Figure(figsize=(WIDTH_IN, HEIGHT_IN), layout="constrained")
    fps, quality, delay, rate = figure.subplots(4, 1, sharex=True)
    _draw_fps(fps, video)
    _draw_quality(quality, video)
    _draw_delay(delay, video)
    _draw_rate(rate, video)
    end_s = max(video.end_s, video.frames[-1]["sent"])
    for axes in (fps, quality, delay, rate):
        _shade(axes, video.radio, end_s)
        for mark in timeline["marks"]:
            axes.axvline(mark["t_s"], color="#8a2be2", linewidth=1.0, linestyle="--")
        axes.axvline(video.end_s, color="#444444", linewidth=1.0)
        axes.grid(visible=True, linewidth=0.4, alpha=0.6)
        axes.margins(x=0.01)
    fps.set_title(title, fontsize=10, loc="left")
    said = f"stream ended: {video.criterion}" if video.criterion else "stream ended"
    fps.annotate(
        f"{said}, {video.end_s:.1f} s", (video.end_s, 1.0), xycoords=("data", "axes fraction"), ha="right", va="bottom", fontsize=8
    )
    rate.set_xlabel("seconds since lift-off")
    known = {state.quality for state in video.radio}
    patches = [Patch(facecolor=shade, label=f"radio {name}") for name, shade in SHADES.items() if name in known]
    if patches:
        figure.legend(handles=patches, loc="outside lower right", ncols=3, frameon=False, fontsize=8)
    figure.savefig(path)


def _draw_fps(axes: Axes, video: Video) -> None:
    axes.step(video.windows[:, 0], video.windows[:, 1], where="post", color="#1f5fa8", linewidth=1.3)
    axes.set_ylabel("frames shown\nper second")
    axes.set_ylim(bottom=0.0)


def _draw_quality(axes: Axes, video: Video) -> None:
    points = [(f["shown"], f["ssim"]) for f in video.frames if f["shown"] is not None and f["ssim"] is not None]
    if points:
        axes.plot(*zip(*points, strict=True), color="#2a7f62", linewidth=0.9)
    axes.set_ylabel("SSIM")
    axes.set_ylim(0.0, 1.02)


def _draw_delay(axes: Axes, video: Video) -> None:
    points = [(f["shown"], f["shown"] - f["sent"]) for f in video.frames if f["shown"] is not None]
    if points:
        axes.plot(*zip(*points, strict=True), color="#a0522d", linewidth=0.9)
    axes.set_ylabel("delay, s")
    axes.set_ylim(bottom=0.0)


def _draw_rate(axes: Axes, video: Video) -> None:
    sent_s = np.array([frame["sent"] for frame in video.frames])
    bits = np.array([8.0 * frame["bytes"] for frame in video.frames])
    target = np.array([frame["target_bps"] or np.nan for frame in video.frames])
    axes.plot(*_per_second(sent_s, bits), color="#1f5fa8", label="sent", linewidth=1.3)
    axes.plot(sent_s, target * KILO, color="#777777", linewidth=0.8, label="target of the adaptation")
    if video.radio:
        steps = [*video.radio, RadioState(float(sent_s[-1]), "", "", video.radio[-1].down_bps)]
        axes.step(
            [s.t_s for s in steps],
            [s.down_bps * KILO for s in steps],
            where="post",
            color="#c0392b",
            linewidth=0.9,
            label="the radio carries",
        )
    axes.set_yscale("log")
    axes.set_ylabel("kbit/s")
    axes.set_xlim(left=float(sent_s[0]) - 1.0)
    axes.legend(loc="upper right", fontsize=7, frameon=False, ncols=3)


def _per_second(at_s: Floats, bits: Floats) -> tuple[Floats, Floats]:
    edges = np.arange(np.floor(at_s[0]), at_s[-1] + 1.0, 1.0)
    sums, _ = np.histogram(at_s, edges, weights=bits)
    return edges[:-1] + 0.5, np.maximum(sums * KILO, 1.0)


def _shade(axes: Axes, radio: Sequence[RadioState], end_s: float) -> None:
    """Show where the radio was worse than good."""
    for state, after in zip(radio, [*(s.t_s for s in radio[1:]), end_s], strict=False):
        if state.quality in SHADES and after > state.t_s:
            axes.axvspan(state.t_s, after, color=SHADES[state.quality], linewidth=0, zorder=0)
