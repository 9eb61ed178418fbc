"""``timeline.svg``: the timeline as a chart, a row a skill (paper, Figures 11 and 12) and below a row a changing resource."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from alula.common.robots import page_words
from alula.report.timeline import Bar, Mark, ResourceRow, SkillRow, Timeline

# After Okabe and Ito (2008): told apart by the colour-blind and, with the hatching of a violation, in grey print too.
COLOURS = {
    "success": "#2a9d78",
    "ended": "#8aa59b",
    "interrupted": "#a6a6a6",
    "violated": "#c8322b",
    "failure": "#f0a202",
    "running": "#4a90c4",
}
MEANINGS = {
    "success": "ended by itself",
    "ended": "ended, success unknown",
    "interrupted": "interrupted",
    "violated": "invariant violated",
    "failure": "failed or refused",
    "running": "still running",
}
TEXT_ON = {"success": "white", "ended": "black", "interrupted": "black", "violated": "white", "failure": "black", "running": "white"}
MARK_STYLES = {"failure": ("#c8322b", "-"), "detected": ("#7b2cbf", "--"), "fallback": ("#1d4e89", "-."), "moving": ("#2a6f4e", ":")}
BAND_SHADES = ("#dfe5ec", "#8fa3ba", "#c3cede", "#6d87a3")
WIDTH_IN = 11.0
LEFT_IN, RIGHT_IN, BOTTOM_IN = 1.6, 0.2, 0.95
SKILL_ROW_IN, RESOURCE_ROW_IN, MARK_ROW_IN, TITLE_IN = 0.34, 0.26, 0.17, 0.38
LABEL_PT, BAND_PT = 6.5, 6.0
BAR_HEIGHT, BAND_HEIGHT = 0.66, 0.72
GROUP_NAME = 0.55  # row heights above each group, for its name
INSTANT_S = 0.05
LABELS = {"NOT_READY": "not ready", "NOT_VALIDATED": "refused", "FAILED": "error", "INTERRUPTED": "interrupted"}
SVG_STYLE = {"svg.fonttype": "none", "svg.hashsalt": "alula", "font.family": "DejaVu Sans", "hatch.linewidth": 0.6}


@dataclass(frozen=True)
class Rows:
    """Where each row stands: y of its middle in row heights, growing downwards, and the bottom of all."""

    skills: list[float]
    resources: list[float]
    bottom: float


class Ruler:
    """Measures texts and durations on the time axis, in points."""

    def __init__(self, figure: Figure, points_per_s: float) -> None:
        self._renderer = FigureCanvasAgg(figure).get_renderer()
        self._pixels_per_point = figure.dpi / 72
        self._points_per_s = points_per_s

    def text_s(self, text: str, size_pt: float) -> float:
        """Return how many seconds of the axis a text covers, with a little air."""
        font = mpl.font_manager.FontProperties(family="DejaVu Sans", size=size_pt)
        width, _, _ = self._renderer.get_text_width_height_descent(text, font, ismath=False)
        return float(width / self._pixels_per_point + 4.0) / self._points_per_s


def draw_timeline(timeline: Timeline, path: Path, *, title: str) -> None:
    """Write the chart; the file's suffix decides the format (svg, png, pdf)."""
    with mpl.rc_context(SVG_STYLE):
        figure = _figure(timeline, title)
        metadata = {"Date": None, "Title": title} if path.suffix == ".svg" else {}
        figure.savefig(path, metadata=metadata, dpi=150)


def _figure(timeline: Timeline, title: str) -> Figure:
    rows = _rows(timeline)
    header_in = TITLE_IN + MARK_ROW_IN * len(timeline["marks"])
    body_in = max(rows.bottom, 1.0) * SKILL_ROW_IN
    height_in = header_in + body_in + BOTTOM_IN
    figure = Figure(figsize=(WIDTH_IN, height_in))
    width_in = WIDTH_IN - LEFT_IN - RIGHT_IN
    axes = figure.add_axes((LEFT_IN / WIDTH_IN, BOTTOM_IN / height_in, width_in / WIDTH_IN, body_in / height_in))
    begin_s, end_s = _span(timeline)
    axes.set_xlim(begin_s, end_s)
    axes.set_ylim(max(rows.bottom, 1.0), 0)
    ruler = Ruler(figure, 72 * width_in / (end_s - begin_s))
    _paper(axes, timeline, rows)
    for row, y in zip(timeline["skills"], rows.skills, strict=True):
        _draw_bars(axes, row, y, end_s, ruler)
    for resource, y in zip(timeline["resources"], rows.resources, strict=True):
        _draw_bands(axes, resource, y, ruler)
    _draw_marks(axes, timeline["marks"], body_in, ruler)
    _draw_legend(figure, timeline, height_in)
    figure.text(LEFT_IN / WIDTH_IN, 1 - 0.12 / height_in, title, va="top", ha="left", fontsize=10, fontweight="bold")
    return figure


def _span(timeline: Timeline) -> tuple[float, float]:
    """Return the time axis: all that happened, a little air, and never nothing."""
    begin_s = min([0.0, timeline["begin_s"], *(mark["t_s"] for mark in timeline["marks"])])
    end_s = max([timeline["end_s"], begin_s + 1.0, *(mark["t_s"] for mark in timeline["marks"])])
    air_s = 0.01 * (end_s - begin_s)
    return begin_s - air_s, end_s + air_s


def _rows(timeline: Timeline) -> Rows:
    y, skillset = 0.0, None
    skills, resources = [], []
    for row in timeline["skills"]:
        y += GROUP_NAME if row["skillset"] != skillset else 0.0
        skillset = row["skillset"]
        skills.append(y + 0.5)
        y += 1.0
    y += GROUP_NAME if timeline["resources"] else 0.0
    for _ in timeline["resources"]:
        step = RESOURCE_ROW_IN / SKILL_ROW_IN
        resources.append(y + step / 2)
        y += step
    return Rows(skills, resources, y)


def _paper(axes: Axes, timeline: Timeline, rows: Rows) -> None:
    """Draw axes, names of rows and the ground of each skillset."""
    for side in ("top", "right", "left"):
        axes.spines[side].set_visible(False)
    names = [row["skill"] for row in timeline["skills"]] + [row["resource"] for row in timeline["resources"]]
    axes.set_yticks(rows.skills + rows.resources, names)
    axes.tick_params(axis="y", length=0, labelsize=8)
    axes.tick_params(axis="x", labelsize=8)
    axes.xaxis.set_major_locator(MaxNLocator(nbins=12, steps=[1, 2, 5, 10]))
    axes.grid(axis="x", color="#d9d9d9", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.set_xlabel(f"time since {page_words()['departure']} (s)", fontsize=9)
    for label in axes.get_yticklabels()[len(rows.skills) :]:
        label.set(fontsize=7, color="#44546a", style="italic")
    for skillset in dict.fromkeys(row["skillset"] for row in timeline["skills"]):
        inside = [y for row, y in zip(timeline["skills"], rows.skills, strict=True) if row["skillset"] == skillset]
        _name_group(axes, skillset, inside[0] - 0.5, inside[-1] + 0.5)
    if rows.resources:
        _name_group(axes, "resources", rows.resources[0] - 0.4, rows.resources[-1] + 0.4)


def _name_group(axes: Axes, name: str, top: float, bottom: float) -> None:
    axes.axhspan(top, bottom, color="#f5f6f8", zorder=0)
    left = -(LEFT_IN - 0.15) / (WIDTH_IN - LEFT_IN - RIGHT_IN)
    across = axes.get_yaxis_transform()
    axes.plot([left, 1], [top, top], transform=across, clip_on=False, color="#b9c0cb", linewidth=0.6, zorder=1)
    axes.text(left, top - 0.1, name, transform=across, ha="left", va="bottom", fontsize=7.5, color="#44546a", fontweight="bold")


def _draw_bars(axes: Axes, row: SkillRow, y: float, end_s: float, ruler: Ruler) -> None:
    bars = row["bars"]
    for bar, following in zip(bars, [*bars[1:], None], strict=True):
        start_s = bar["start_s"] or 0.0
        length_s = bar["until_s"] - start_s
        colour = COLOURS[bar["ending"]]
        if length_s < INSTANT_S:
            axes.plot([start_s], [y], marker="D", markersize=5, color=colour, markeredgecolor="black", markeredgewidth=0.4, zorder=4)
        else:
            hatch = "////" if bar["ending"] == "violated" else None
            axes.barh(y, length_s, BAR_HEIGHT, left=start_s, color=colour, edgecolor="white", linewidth=0.6, hatch=hatch, zorder=3)
        _label_bar(axes, bar, y, end_s if following is None else following["start_s"] or 0.0, ruler)


def _label_bar(axes: Axes, bar: Bar, y: float, free_until_s: float, ruler: Ruler) -> None:
    """Write how the execution ended into its bar, or behind it, or nowhere if neither has the room."""
    start_s = bar["start_s"] or 0.0
    for label in _labels(bar):
        needed_s = ruler.text_s(label, LABEL_PT)
        hatched = {"boxstyle": "round,pad=0.15", "facecolor": COLOURS["violated"], "edgecolor": "none"}
        box = hatched if bar["ending"] == "violated" else None
        if needed_s < bar["until_s"] - start_s:
            middle = (start_s + bar["until_s"]) / 2
            colour = TEXT_ON[bar["ending"]]
            axes.text(middle, y, label, ha="center", va="center_baseline", fontsize=LABEL_PT, color=colour, bbox=box, zorder=7)
            return
        air_s = ruler.text_s("", LABEL_PT)
        if needed_s + air_s < free_until_s - bar["until_s"]:
            axes.text(bar["until_s"] + air_s, y, label, ha="left", va="center_baseline", fontsize=LABEL_PT, color="#333333", zorder=7)
            return


def _labels(bar: Bar) -> Sequence[str]:
    """Return what can be written at a bar, the longest first."""
    if bar["outcome"] == "TERMINATED":
        return [bar["result"]] if bar["result"] else []
    if bar["outcome"] == "RESOURCE_INVARIANT_VIOLATED":
        return [f"{bar['result']} violated", bar["result"], "violated"]
    label = LABELS.get(bar["outcome"], bar["outcome"].lower())
    reason = [f"{label}: {bar['result']}"] if bar["result"] else []
    return [*reason, label]


def _draw_bands(axes: Axes, row: ResourceRow, y: float, ruler: Ruler) -> None:
    shades: dict[str, str] = {}
    height = BAND_HEIGHT * RESOURCE_ROW_IN / SKILL_ROW_IN
    for band in row["bands"]:
        shade = shades.setdefault(band["state"], BAND_SHADES[len(shades) % len(BAND_SHADES)])
        colour = "#eab0ab" if band["alarm"] else shade
        length_s = band["until_s"] - band["from_s"]
        axes.barh(y, length_s, height, left=band["from_s"], color=colour, edgecolor="white", linewidth=0.4, zorder=3)
        if ruler.text_s(band["state"], BAND_PT) < length_s:
            middle = (band["from_s"] + band["until_s"]) / 2
            axes.text(middle, y, band["state"], ha="center", va="center_baseline", fontsize=BAND_PT, color="#222222", zorder=7)


def _draw_marks(axes: Axes, marks: Sequence[Mark], body_in: float, ruler: Ruler) -> None:
    """Draw a line a moment through all rows; labels stand one above the other, because the moments lie close together."""
    begin_s, end_s = axes.get_xlim()
    for index, mark in enumerate(marks):
        colour, style = MARK_STYLES[mark["kind"]]
        top = 1 + (MARK_ROW_IN * (len(marks) - index) - 0.06) / body_in
        axes.plot(
            [mark["t_s"]] * 2,
            [0, top],
            transform=axes.get_xaxis_transform(),
            color=colour,
            linestyle=style,
            linewidth=1,
            clip_on=False,
            zorder=6,
        )
        label = f"{mark['label']}, {mark['t_s']:.2f} s"
        left = mark["t_s"] + ruler.text_s(label, 7.5) > end_s
        axes.annotate(
            label,
            (mark["t_s"], top),
            xycoords=axes.get_xaxis_transform(),
            xytext=(-3 if left else 3, 0),
            textcoords="offset points",
            ha="right" if left else "left",
            va="center",
            fontsize=7.5,
            color=colour,
        )
    if begin_s < 0:
        axes.axvline(0, color="#555555", linewidth=0.8, zorder=2)


def _draw_legend(figure: Figure, timeline: Timeline, height_in: float) -> None:
    used = {bar["ending"] for row in timeline["skills"] for bar in row["bars"]}
    handles = [
        Patch(facecolor=COLOURS[name], label=meaning, hatch="////" if name == "violated" else None, edgecolor="white")
        for name, meaning in MEANINGS.items()
        if name in used
    ]
    place = (LEFT_IN / WIDTH_IN, 0.08 / height_in)
    figure.legend(handles=handles, loc="lower left", bbox_to_anchor=place, ncols=5, frameon=False, fontsize=8, handlelength=1.6)
