"""The telepilot's video in numbers: what was sent, what was shown and when. Made of what both ends wrote into ``video/``."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise, takewhile
from pathlib import Path
from typing import Any, TypedDict

import numpy as np
from numpy.typing import NDArray

from alula.common.files import write_aside
from alula.report.files import Problems, finite, mapping
from alula.report.history import History
from uav_report.phases import FlightPhases

FOLDER = "video"
FREEZE_S = 0.5
QUALITIES = ("good", "degraded", "critical", "out")  # of the radio, the best first
VIOLATED = "RESOURCE_INVARIANT_VIOLATED"

Floats = NDArray[np.float64]


class FrameRecord(TypedDict):
    """A line of ``frames.jsonl``; seconds of mission clock since lift-off, null where it never came to that.

    ``sent_index`` and ``received_index``: the picture's number in the films ``sent_film`` and ``received_film``, from 0.
    """

    id: int
    sent: float
    received: float | None
    shown: float | None
    bytes: int
    ssim: float | None
    target_bps: float | None
    sent_film: str
    sent_index: int | None
    received_film: str | None
    received_index: int | None


class VideoSummary(TypedDict):
    """Whole seconds from the first picture to the end of the stream; SSIM and delay over all pictures shown in that time.

    ``freezes``: times of more than 0.5 s without a new picture. ``criterion``: the invariant that ended the stream.
    """

    min_fps: float | None
    p5_fps: float | None
    min_ssim: float | None
    mean_ssim: float | None
    p95_delay_s: float | None
    freezes: int | None
    adaptations: int | None
    criterion: str | None
    sent: int
    shown: int


@dataclass(frozen=True)
class RadioState:
    """The radio's state from a moment on."""

    t_s: float
    quality: str
    cause: str
    down_bps: float


@dataclass(frozen=True)
class Video:
    """The recorded data of a flight's video. Seconds since lift-off."""

    frames: tuple[FrameRecord, ...] = ()
    radio: tuple[RadioState, ...] = ()
    levels: tuple[str, ...] = ()
    """Of each sent frame, its size and frame rate."""
    begin_s: float = 0.0
    end_s: float = 0.0
    criterion: str | None = None
    summary: VideoSummary | None = None
    windows: Floats = field(default_factory=lambda: np.empty((0, 2)))
    """Begin of each whole second, and frames shown in it, (N, 2)."""


def read_video(folder: Path, history: History, phases: FlightPhases, problems: Problems) -> Video:
    """Read what both ends of the video wrote, write ``video/frames.jsonl``, and count."""
    sent = list(_lines(folder / FOLDER, "sent", problems))
    shown = {(int(line["id"]), round(float(line["sent_s"]), 6)): line for line in _lines(folder / FOLDER, "shown", problems)}
    if not sent:
        problems.note(f"{FOLDER}: nothing was sent")
        return Video()
    frames = tuple(_record(line, shown.get((int(line["id"]), round(float(line["sent_s"]), 6))), phases) for line in sent)
    text = "".join(json.dumps(frame) + "\n" for frame in frames)
    write_aside(folder / FOLDER / "frames.jsonl", lambda aside: _write(aside, text))
    levels = tuple(_level(line.get("level")) for line in sent)
    begin_s, end_s, criterion = _span(frames, history, phases)
    windows = count_seconds([f["shown"] for f in frames if f["shown"] is not None], begin_s, end_s)
    radio = tuple(
        RadioState(phases.since(float(line["t_s"])) or 0.0, str(line["quality"]), str(line["cause"]), float(line["down_bps"]))
        for line in _lines(folder / FOLDER, "radio", problems)
    )
    video = Video(frames, radio, levels, begin_s, end_s, criterion, None, windows)
    return Video(**{**vars(video), "summary": summarise_video(video)})


def radio_lost_s(video: Video, phases: FlightPhases) -> float | None:
    """Return when the radio became as bad as it was when the stream failed, absolute seconds of mission clock; None: it did not."""
    if video.criterion is None:
        return None
    before = [state for state in video.radio if state.t_s <= video.end_s]
    if not before or before[-1].quality == QUALITIES[0]:
        return None
    as_bad = takewhile(lambda state: _rank(state) >= _rank(before[-1]), reversed(before))
    return phases.zero_s + min(state.t_s for state in as_bad)


def _rank(state: RadioState) -> int:
    return QUALITIES.index(state.quality)


def summarise_video(video: Video) -> VideoSummary:
    """Count what was shown from the first picture to the end of the stream."""
    shown = [f for f in video.frames if f["shown"] is not None and video.begin_s <= f["shown"] <= video.end_s]
    times = [f["shown"] for f in shown if f["shown"] is not None]
    delays = [f["shown"] - f["sent"] for f in shown if f["shown"] is not None]
    ssim = [f["ssim"] for f in shown if f["ssim"] is not None]
    fps = video.windows[:, 1]
    gaps = [after - before for before, after in pairwise([*times, video.end_s])]
    return VideoSummary(
        min_fps=float(fps.min()) if len(fps) else None,
        p5_fps=float(np.percentile(fps, 5)) if len(fps) else None,
        min_ssim=round(min(ssim), 4) if ssim else None,
        mean_ssim=round(float(np.mean(ssim)), 4) if ssim else None,
        p95_delay_s=round(float(np.percentile(delays, 95)), 3) if delays else None,
        freezes=sum(gap > FREEZE_S for gap in gaps),
        adaptations=sum(before != after for before, after in pairwise(video.levels)),
        criterion=video.criterion,
        sent=len(video.frames),
        shown=len(shown),
    )


def count_seconds(shown_s: Sequence[float], begin_s: float, end_s: float) -> Floats:
    """Return the whole seconds from begin to end with the pictures shown in each, (N, 2)."""
    edges = np.arange(begin_s, end_s + 1e-9, 1.0)
    if len(edges) < 2:
        return np.empty((0, 2))
    counts, _ = np.histogram(np.asarray(shown_s, dtype=np.float64), edges)
    return np.column_stack([edges[:-1], counts])


def _span(frames: Sequence[FrameRecord], history: History, phases: FlightPhases) -> tuple[float, float, str | None]:
    """Return when the first picture was shown, when the stream ended, and the invariant that ended it."""
    shown = [frame["shown"] for frame in frames if frame["shown"] is not None]
    streams = history.of_skill("stream")
    last = streams[-1] if streams else None
    end_s = phases.since(last.ended_s) if last is not None and last.ended_s is not None else None
    criterion = last.result if last is not None and last.state.value == VIOLATED else None
    first_s = min(shown, default=frames[0]["sent"])
    return first_s, max(first_s, frames[-1]["sent"] if end_s is None else end_s), criterion


def _record(sent: dict[str, Any], shown: dict[str, Any] | None, phases: FlightPhases) -> FrameRecord:
    at = shown or {}
    return FrameRecord(
        id=int(sent["id"]),
        sent=phases.since(finite(sent["sent_s"])) or 0.0,
        received=phases.since(finite(at.get("received_s"))),
        shown=phases.since(finite(at.get("shown_s"))),
        bytes=int(sent["bytes"]),
        ssim=finite(at.get("ssim")),
        target_bps=finite(sent.get("target_bps")),
        sent_film=str(sent.get("film", "sent")),
        sent_index=_whole(sent.get("index")),
        received_film=str(at["film"]) if "film" in at else None,
        received_index=_whole(at.get("index")),
    )


def _whole(value: object) -> int | None:
    return value if isinstance(value, int) else None


def _level(value: object) -> str:
    level = mapping(value)
    return f"{level.get('scale')} at {level.get('fps')}"


def _lines(folder: Path, stem: str, problems: Problems) -> Iterator[dict[str, Any]]:
    """Yield the lines of all lives of a process, in order; a line that was cut off is noted."""
    paths = sorted(folder.glob(f"{stem}*.jsonl"), key=lambda path: (len(path.name), path.name))
    if not paths:
        problems.note(f"{FOLDER}/{stem}.jsonl is missing")
    for path in paths:
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1):
            try:
                yield mapping(json.loads(line))
            except ValueError:
                problems.note(f"{FOLDER}/{path.name}: line {number} was cut off")


def _write(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8")
