"""What flights cost, as a picture: a bar each process, its phases in a row; another checkout's flights beside them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flight_bench.figures import Figures, typical
from flight_bench.watching import FLIGHT, PHASES, REPORT, START

# After Okabe and Ito (2008): told apart by the colour-blind.
COLOURS = {START: "#e69f00", FLIGHT: "#0072b2", REPORT: "#009e73"}
SVG_STYLE = {"svg.fonttype": "none", "svg.hashsalt": "alula", "font.family": "DejaVu Sans"}
WIDTH_IN, ROW_IN, FRAME_IN = 8.5, 0.3, 1.4


def draw(flown: Sequence[Sequence[Figures]], path: Path) -> None:
    """Write the picture of each checkout's flights (medians), dearest process of the first one on top."""
    costs = [typical([one.taken.cpu_s for one in flights]) for flights in flown]
    names = sorted({name for cost in costs for name in cost}, key=lambda name: -sum(costs[0].get(name, {}).values()))
    with mpl.rc_context(SVG_STYLE):
        figure = Figure(figsize=(WIDTH_IN, FRAME_IN + ROW_IN * len(names)), layout="constrained")
        columns = figure.subplots(1, len(flown), squeeze=False, sharex=True, sharey=True)[0]
        for axes, flights, cost in zip(columns, flown, costs, strict=True):
            _bars(axes, [cost.get(name, {}) for name in names])
            whole_s = sum(seconds for row in cost.values() for seconds in row.values())
            name = f"{Path(flights[0].checkout).name}: " if len(flown) > 1 else ""
            axes.set_title(f"{name}{whole_s:.0f} s in all", fontsize=10)
            axes.set_xlabel("seconds of processor time")
        columns[0].set_yticks(range(len(names)), names)
        columns[0].invert_yaxis()
        figure.legend(*columns[0].get_legend_handles_labels(), loc="outside upper left", ncols=len(PHASES), frameon=False)
        figure.savefig(path, metadata={"Date": None} if path.suffix == ".svg" else None)


def _bars(axes: Axes, rows: Sequence[dict[str, float]]) -> None:
    places = range(len(rows))
    left = [0.0] * len(rows)
    for phase in PHASES:
        widths = [row.get(phase, 0.0) for row in rows]
        axes.barh(places, widths, 0.75, left, color=COLOURS[phase], label=phase)
        left = [begin + width for begin, width in zip(left, widths, strict=True)]
    for place, whole_s in zip(places, left, strict=True):
        axes.annotate(f"{whole_s:.1f}", (whole_s, place), (4, 0), textcoords="offset points", va="center", fontsize=8)
    axes.use_sticky_edges = False  # else the longest bar's figure stands outside
    axes.margins(x=0.1)
    axes.set_xlim(left=0.0)
    axes.grid(axis="x", color="#dddddd", linewidth=0.6)
    axes.set_axisbelow(True)
