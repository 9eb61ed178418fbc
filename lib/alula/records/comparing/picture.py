"""Compared runs as a picture: a row a skill with a bar of each run, or, of many runs, each figure as a row of dots."""

from __future__ import annotations

from pathlib import Path
from statistics import median

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from alula.records.comparing.rendering import SIDE_BY_SIDE
from alula.records.comparing.sides import Compared

# After Okabe and Ito (2008): told apart by the colour-blind.
COLOURS = ("#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00")
SVG_STYLE = {"svg.fonttype": "none", "svg.hashsalt": "alula", "font.family": "DejaVu Sans"}
WIDTH_IN, ROW_IN, FRAME_IN = 11.0, 0.16, 1.5
GAP = 0.6
"""Between the rows of two skills, in bars."""


def draw(compared: Compared, path: Path) -> None:
    """Write the picture, in the format of the file's suffix."""
    with mpl.rc_context(SVG_STYLE):
        figure = _timeline(compared) if len(compared.sides) <= SIDE_BY_SIDE else _distributions(compared)
        figure.savefig(path, metadata={"Date": None} if path.suffix == ".svg" else None)


def _timeline(compared: Compared) -> Figure:
    sides = compared.sides
    skills = list(dict.fromkeys(skill for side in sides for skill, _, _ in side.spans))
    height = len(sides) + GAP
    figure = Figure(figsize=(WIDTH_IN, FRAME_IN + ROW_IN * height * len(skills)), layout="constrained")
    axes: Axes = figure.subplots()
    for number, side in enumerate(sides):
        for skill, begin_s, end_s in side.spans:
            axes.barh(skills.index(skill) * height + number, max(end_s - begin_s, 0.05), 0.85, begin_s, color=COLOURS[number], linewidth=0)
        axes.barh([0], [0], color=COLOURS[number], label=f"{side.name}: {side.outcome or 'outcome not known'}")
        difference = compared.differences[number - 1] if number else None
        if difference is not None and difference.other is not None:
            axes.axvline(difference.other.at_s, color=COLOURS[number], linestyle="--", linewidth=1.0)
    axes.set_yticks([row * height + (len(sides) - 1) / 2 for row in range(len(skills))], skills)
    axes.invert_yaxis()
    axes.set_xlabel("seconds since the departure; dashed: the first decision that is not that of the first run")
    axes.grid(axis="x", color="#dddddd", linewidth=0.6)
    axes.set_axisbelow(True)
    figure.legend(loc="outside upper left", ncols=min(3, len(sides)), frameon=False)
    return figure


def _distributions(compared: Compared) -> Figure:
    shown = {name: some for name in compared.units if (some := compared.values(name))}
    figure = Figure(figsize=(WIDTH_IN, 0.75 * len(shown) + 0.6), layout="constrained")
    rows = figure.subplots(max(len(shown), 1), 1, squeeze=False)[:, 0]
    for axes, (name, some) in zip(rows, shown.items(), strict=False):
        axes.plot(some, [0.0] * len(some), "|", color=COLOURS[0], markersize=14, alpha=0.5)
        axes.plot([median(some)], [0.0], "o", color=COLOURS[5], markersize=5)
        axes.set_yticks([0.0], [f"{name} {compared.units[name]}".rstrip()])
        axes.spines[["top", "right", "left"]].set_visible(False)
    figure.suptitle(f"{len(compared.sides)} runs; a stroke a run, the dot is the median")
    return figure
