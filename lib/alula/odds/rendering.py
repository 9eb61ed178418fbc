"""The odds as text, as JSON, and as a picture."""

from __future__ import annotations

from html import escape

from alula.odds.odds import Between, Cost, Odds
from alula.odds.storm import Number

WORDS = {"accomplished": "accomplished", "degraded": "degraded", "given_up": "given up in order", "neither": "neither"}
COLOURS = {"accomplished": "#2a9d78", "degraded": "#f0a202", "given_up": "#4a90c4", "neither": "#c8322b"}
MOST_COSTS = MOST_LACKING = 12
WIDTH_PX, LEFT_PX, BAR_PX, ROW_PX, TOP_PX = 760, 160, 420, 30, 44
FONT = "font-family='DejaVu Sans, Helvetica, sans-serif'"


def as_text(title: str, odds: Odds, changes: dict[str, Odds]) -> str:
    """Return the odds, and those after each change, as lines for a terminal."""
    lines = [title, *(f"  {WORDS[name]:<18} {_chance(one)}" for name, one in odds.outcomes.items())]
    lines += [f"  {'mean time to end':<18} {_seconds(odds)}"]
    if odds.lacking:
        more = len(odds.lacking) - MOST_LACKING
        names = ", ".join(odds.lacking[:MOST_LACKING]) + (f" and {more} more" if more > 0 else "")
        lines += [f"no figures for {names}: their chances count as anything from 0 to 1"]
        lines += ["write them in the robot's `faults.yaml`, under `faults`, `transitions` and `skills` (docs/how-to/odds.md)"]
    if odds.costs:
        lines += ["what costs most, of the least chance that it is accomplished, degraded or not:"]
        lines += [f"  {one.name:<34} {_cost(one)}" for one in odds.costs[:MOST_COSTS]]
    for change, other in changes.items():
        lines += [f"with {change}:", *(f"  {WORDS[name]:<18} {_chance(one)}" for name, one in other.outcomes.items())]
    lines += [f"{odds.situations} situations, {odds.states} states of the decision process"]
    if odds.open:
        lines += [f"the search stopped before {odds.open} situations were looked at: the bounds hold, and are wider than need be"]
        lines += ["what follows from these counts as the worst: costs are upper bounds; a smaller `--unlikely` narrows them"]
    return "\n".join(lines) + "\n"


def as_dict(odds: Odds, changes: dict[str, Odds]) -> dict[str, object]:
    """Return what `--json` prints: chances as [least, greatest], exact ones also as fractions; times in seconds."""
    least_s, most_s = odds.seconds
    found: dict[str, object] = {
        "outcomes": {name: _between(one) for name, one in odds.outcomes.items()},
        "seconds": [least_s and least_s.value, most_s and most_s.value],
        "costs": [{"name": one.name, "slope": one.slope, "without": one.without} for one in odds.costs],
        "situations": odds.situations,
        "states": odds.states,
        "open": odds.open,
        "lacking": list(odds.lacking),
    }
    return found | ({"with": {change: as_dict(other, {}) for change, other in changes.items()}} if changes else {})


def as_svg(title: str, odds: Odds) -> str:
    """Return the odds as SVG: one bar for each outcome, in full colour up to its least chance, pale up to its greatest."""
    rows = [_row(number, name, one) for number, (name, one) in enumerate(odds.outcomes.items())]
    height = TOP_PX + ROW_PX * len(rows) + 12
    head = f"<svg xmlns='http://www.w3.org/2000/svg' width='{WIDTH_PX}' height='{height}' {FONT} font-size='13'>"
    ground = f"<rect width='{WIDTH_PX}' height='{height}' fill='white'/>"
    return "\n".join([head, ground, f"<text x='14' y='26' font-size='15'>{escape(title)}</text>", *rows, "</svg>"]) + "\n"


def _row(number: int, name: str, one: Between) -> str:
    y = TOP_PX + number * ROW_PX
    least, most = one.least.value * BAR_PX, one.most.value * BAR_PX
    return (
        f"<text x='14' y='{y + 15}'>{WORDS[name]}</text>"
        f"<rect x='{LEFT_PX}' y='{y}' width='{BAR_PX}' height='20' fill='#eef1f5'/>"
        f"<rect x='{LEFT_PX}' y='{y}' width='{most:.2f}' height='20' fill='{COLOURS[name]}' fill-opacity='0.35'/>"
        f"<rect x='{LEFT_PX}' y='{y}' width='{least:.2f}' height='20' fill='{COLOURS[name]}'/>"
        f"<text x='{LEFT_PX + BAR_PX + 8}' y='{y + 15}'>{_chance(one)}</text>"
    )


def _chance(one: Between) -> str:
    if one.least.value == one.most.value:
        return _digits(one.least)
    return f"{_digits(one.least)} to {_digits(one.most)}"


def _digits(number: Number) -> str:
    return f"{number.value:.9g}"


def _seconds(odds: Odds) -> str:
    least, most = odds.seconds
    if least is None:
        return "it may never end"
    if most is None:
        return f"{least.value:.6g} s or more, without a bound"
    return f"{least.value:.6g} s" if least.value == most.value else f"{least.value:.6g} to {most.value:.6g} s"


def _cost(one: Cost) -> str:
    slope = f"{one.slope:+.3g} per {'1 of its chance' if ' at ' in one.name else 'fault an hour'}"
    return slope if one.without is None else f"{slope}; {one.without:+.3g} if it never came"


def _between(one: Between) -> dict[str, object]:
    found: dict[str, object] = {"chance": [one.least.value, one.most.value]}
    if one.least.exact and one.most.exact:
        found["exact"] = [str(one.least.low), str(one.most.low)]
    return found
