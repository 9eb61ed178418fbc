"""``map.png``: the map from above and from the side (paper, Figures 8 and 9), with the true outlines, the route and the path flown."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke

from uav_report.map_quality import Floats
from uav_report.recording import Track
from uav_report.world import TrueSurfaces

DPI = 160
PLAN_WIDTH_IN, PLAN_HEIGHT_IN = 9.2, 8.0  # at most
NARROWEST_IN = 7.0  # the legend's width
LEFT_IN, RIGHT_IN, TOP_IN, BOTTOM_IN, BETWEEN_IN = 0.65, 1.15, 0.45, 0.95, 0.55
CELL_M = 0.15
AIR_M = np.array([2.0, 2.0, 0.5])
SURROUNDINGS_M = 10.0
SMALLEST_M = np.array([20.0, 12.0, 4.0])
HEIGHT_COLOURS = "viridis"
BEFORE, AFTER, ROUTE, MISSED, OUTLINE, ALARM = "#d1495b", "#f79d1e", "#222222", "#e6a5b5", "#8a8f98", "#b00020"


@dataclass(frozen=True)
class MapScene:
    """The content of the picture, frame map; None where a run left nothing. ``failure_s``: absolute mission clock, like the path's."""

    points: Floats | None
    missed: Floats | None
    world: TrueSurfaces | None
    route: Floats | None
    path: Track | None
    failure_s: float | None
    failed: str


@dataclass(frozen=True)
class View:
    """A projection: which coordinates go right and up, and what to write at the axes."""

    right: int
    up: int
    depth: int


FROM_ABOVE = View(0, 1, 2)
FROM_SOUTH = View(0, 2, 1)


def draw_map(scene: MapScene, path: Path, *, title: str) -> None:
    """Write the picture; both views share the horizontal axis and one scale, metres."""
    low, high = _extent(scene)
    plan_in, side_in, size_in = _layout(high - low)
    with mpl.rc_context({"font.family": "DejaVu Sans"}):
        figure = Figure(figsize=size_in)
        plan, side, bar = (figure.add_axes(box.in_figure(size_in)) for box in (plan_in, side_in, plan_in.bar_beside()))
        colours = mpl.colors.Normalize(*_heights(scene))
        for axes, view in ((plan, FROM_ABOVE), (side, FROM_SOUTH)):
            _draw_view(axes, view, scene, (low, high), colours)
            axes.set(xlim=(low[0], high[0]), ylim=(low[view.up], high[view.up]))
        plan.set_ylabel("north (m)", fontsize=9)
        side.set_ylabel("height (m)", fontsize=9)
        side.set_xlabel("east (m)", fontsize=9)
        plan.set_title(title, loc="left", fontsize=10, fontweight="bold")
        figure.colorbar(mpl.cm.ScalarMappable(colours, HEIGHT_COLOURS), cax=bar).set_label("height of the mapped points (m)", fontsize=9)
        bar.tick_params(labelsize=8)
        handles, labels = plan.get_legend_handles_labels()
        corner = (LEFT_IN / size_in[0], 0.06 / size_in[1])
        figure.legend(handles, labels, loc="lower left", bbox_to_anchor=corner, ncols=5, frameon=False, fontsize=8)
        figure.savefig(path, dpi=DPI, metadata={"Title": title})


@dataclass(frozen=True)
class Box:
    """A rectangle on the paper, inches from its lower left corner."""

    left: float
    bottom: float
    width: float
    height: float

    def in_figure(self, size_in: tuple[float, float]) -> tuple[float, float, float, float]:
        """Return the rectangle in fractions of the paper."""
        return (self.left / size_in[0], self.bottom / size_in[1], self.width / size_in[0], self.height / size_in[1])

    def bar_beside(self) -> Box:
        """Return the place for a colour bar on the right."""
        return Box(self.left + self.width + 0.18, self.bottom, 0.16, self.height)


def _layout(span_m: Floats) -> tuple[Box, Box, tuple[float, float]]:
    """Return the boxes of plan and side view and the size of the paper: one scale everywhere, so that metres look equal."""
    in_per_m = float(min(PLAN_WIDTH_IN / span_m[0], PLAN_HEIGHT_IN / span_m[1]))
    width, plan, side = (float(in_per_m * length) for length in span_m)
    size = (LEFT_IN + max(width, NARROWEST_IN) + RIGHT_IN, BOTTOM_IN + side + BETWEEN_IN + plan + TOP_IN)
    return Box(LEFT_IN, BOTTOM_IN + side + BETWEEN_IN, width, plan), Box(LEFT_IN, BOTTOM_IN, width, side), size


def _extent(scene: MapScene) -> tuple[Floats, Floats]:
    """Return the corners of the box that is shown: what was planned, flown and mapped, and the world around it."""
    shown = [array for array in (scene.route, None if scene.path is None else scene.path.position_enu_m) if array is not None]
    if scene.points is not None:
        # Single stray echoes must not shrink all the rest.
        shown.append(np.quantile(scene.points, [0.002, 0.998], axis=0))
    if scene.world is not None:
        around = np.concatenate(shown) if shown else scene.world.vertices
        near = (around.min(axis=0) - SURROUNDINGS_M, around.max(axis=0) + SURROUNDINGS_M)
        shown.append(scene.world.vertices.clip(*near))
    corners = np.concatenate(shown) if shown else np.array([[-10.0, -10.0, 0.0], [10.0, 10.0, 5.0]])
    low, high = corners.min(axis=0) - AIR_M, corners.max(axis=0) + AIR_M
    # A run that hardly moved still gets a picture of which one can read something.
    lacking = np.maximum(SMALLEST_M - (high - low), 0.0)
    return low - lacking / 2, high + lacking / 2


def _heights(scene: MapScene) -> tuple[float, float]:
    if scene.points is None:
        return 0.0, 1.0
    low, high = np.quantile(scene.points[:, 2], [0.01, 0.995])
    return float(low), float(max(high, low + 0.5))


def _draw_view(axes: Axes, view: View, scene: MapScene, box: tuple[Floats, Floats], colours: mpl.colors.Normalize) -> None:
    axes.set_facecolor("white")
    axes.grid(color="#eceff3", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.tick_params(labelsize=8)
    flat = [view.right, view.up]
    if scene.missed is not None and view is FROM_ABOVE:
        x, y = scene.missed[:, flat].T
        axes.plot(x, y, color=MISSED, marker="s", markersize=1.3, markeredgewidth=0, linestyle="none")
        axes.plot([], [], color=MISSED, marker="s", markersize=5, linestyle="none", label="in reach, not mapped")
    if scene.points is not None:
        heights = topmost(scene.points, view, box)
        extent = (box[0][view.right], box[1][view.right], box[0][view.up], box[1][view.up])
        axes.imshow(
            heights, cmap=HEIGHT_COLOURS, norm=colours, extent=extent, origin="lower", interpolation="nearest", aspect="auto", zorder=2
        )
    if scene.world is not None:
        outline = scene.world.outline()[:, :, flat]
        axes.add_collection(LineCollection(list(outline), colors=OUTLINE, linewidths=0.5, alpha=0.6, label="true surfaces"))
    if scene.route is not None:
        x, y = scene.route[:, flat].T
        axes.plot(x, y, color=ROUTE, linewidth=1, linestyle=(0, (4, 3)), marker="o", markersize=2.5, label="planned route", zorder=6)
    if scene.path is not None:
        _draw_path(axes, scene.path, flat, scene)


def topmost(points: Floats, view: View, box: tuple[Floats, Floats]) -> Floats:
    """Return the height of the point that hides the others, a cell of 0.15 m each, rows upwards; NaN where none is.

    From above the highest point is seen, from the south the southernmost.
    """
    low, high = box
    columns, rows = (int(np.ceil((high[axis] - low[axis]) / CELL_M)) for axis in (view.right, view.up))
    cells = np.full((rows, columns), np.nan)
    inside = ((points >= low) & (points < high)).all(axis=1)
    order = np.argsort(points[inside, view.depth])
    seen = points[inside][order if view is FROM_ABOVE else order[::-1]]
    column = ((seen[:, view.right] - low[view.right]) / (high[view.right] - low[view.right]) * columns).astype(int)
    row = ((seen[:, view.up] - low[view.up]) / (high[view.up] - low[view.up]) * rows).astype(int)
    cells[row, column] = seen[:, 2]
    return cells


def _draw_path(axes: Axes, path: Track, flat: list[int], scene: MapScene) -> None:
    """Draw the path in two colours, before and after the failure, with start, end and the place of the failure."""
    places = path.position_enu_m[:, flat]
    broken = len(places) if scene.failure_s is None else int(np.searchsorted(path.t_s, scene.failure_s))
    fails = broken < len(places)
    _draw_stretch(axes, places[: broken + 1], BEFORE, "flown before the failure" if fails else "flown")
    if fails:
        _draw_stretch(axes, places[broken:], AFTER, "flown after it")
        _draw_place(axes, places[broken], "X", ALARM, f"{scene.failed or 'sensor'} fails")
    _draw_place(axes, places[0], "^", BEFORE, "start")
    _draw_place(axes, places[-1], "s", AFTER if fails else BEFORE, "end")


def _draw_stretch(axes: Axes, places: Floats, colour: str, label: str) -> None:
    halo = [withStroke(linewidth=3, foreground="white", alpha=0.8)]
    axes.plot(places[:, 0], places[:, 1], color=colour, linewidth=1.6, label=label, path_effects=halo, zorder=5)


def _draw_place(axes: Axes, place: Floats, marker: str, colour: str, label: str) -> None:
    style = {"X": 11, "^": 8, "s": 7}
    axes.plot(
        [place[0]],
        [place[1]],
        marker=marker,
        color=colour,
        markersize=style[marker],
        markeredgecolor="white",
        linestyle="none",
        label=label,
        zorder=8 if marker == "X" else 7,
    )
