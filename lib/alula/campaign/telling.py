"""The coverage as text and as a page."""

from __future__ import annotations

from html import escape

from alula.campaign.coverage import Cover, Coverage

_STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; margin: 2rem auto; max-width: 70rem; padding: 0 1rem; color: #1b2430; background: #fff }
h1 { font-size: 1.4rem } h2 { font-size: 1.05rem; margin-top: 1.8rem }
table { border-collapse: collapse; width: 100% } th, td { text-align: left; padding: .3rem .6rem; border-bottom: 1px solid #d9dfe6 }
td.n, th.n { text-align: right; font-variant-numeric: tabular-nums } tr.never td { color: #6b7786; background: #fbf3e6 }
.bar { display: inline-block; height: .6rem; background: #3b7dd8; margin-right: .4rem; vertical-align: baseline }
"""
_HEAD = ("way to fail", "times", "response", "outcomes", "worst recovery", "worst clearance")


def counted(names: dict[str, int]) -> str:
    """Return ``12 navigation.hover, 3 no skill``."""
    return ", ".join(f"{times} {name}" for name, times in names.items())


def shown(value: float | None, unit: str) -> str:
    """Return a number with its unit, or a dash."""
    return "-" if value is None else f"{value:.2f} {unit}"


def _cells(cover: Cover) -> tuple[str, ...]:
    responses, outcomes = dict(cover.responses.most_common()), dict(cover.outcomes.most_common())
    worst = shown(cover.worst_after_s, "s"), shown(cover.worst_clearance_m, "m")
    return f"{cover.way.kind}: {cover.way.name}", str(cover.times), counted(responses), counted(outcomes), *worst


def as_text(coverage: Coverage) -> str:
    """Return the matrix as lines: first what was tried, then what never was."""
    tried = [_HEAD, *(_cells(cover) for cover in coverage.covers if cover.times)]
    widths = [min(60, max(len(row[column]) for row in tried)) for column in range(len(_HEAD))]
    lines = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in tried]
    lines += ["", f"never tried ({len(coverage.never)}):", *(f"  {way.kind}: {way.name}" for way in coverage.never)]
    troubled = ", ".join(map(str, coverage.troubled[:20])) + (", ..." if len(coverage.troubled) > 20 else "")
    lines += ["", f"{coverage.runs} runs: {counted(dict(coverage.outcomes))}"]
    lines += [f"runs with trouble: {len(coverage.troubled)}{f' ({troubled})' if troubled else ''}"]
    return "\n".join(lines) + "\n"


def as_page(coverage: Coverage, title: str) -> str:
    """Return a page that needs nothing else."""
    most = max((cover.times for cover in coverage.covers), default=1) or 1
    head = "".join(f"<th{' class=n' if name == 'times' else ''}>{name}</th>" for name in _HEAD)
    rows = [_row(cover, most) for cover in coverage.covers if cover.times]
    never = [f'<tr class="never"><td colspan="6">{escape(way.kind)}: {escape(way.name)}</td></tr>' for way in coverage.never]
    troubled = ", ".join(map(str, coverage.troubled)) or "none"
    return (
        f'<!doctype html>\n<html lang="en"><meta charset="utf-8"><title>{escape(title)}</title><style>{_STYLE}</style>\n'
        f"<h1>{escape(title)}</h1>\n<p>{coverage.runs} runs: {escape(counted(dict(coverage.outcomes)))}. "
        f"Runs with trouble: {escape(troubled)}.</p>\n"
        f"<h2>What failed, and the mission's responses</h2>\n<table><tr>{head}</tr>\n{chr(10).join(rows)}</table>\n"
        f"<h2>Never tried ({len(never)})</h2>\n<table>{chr(10).join(never)}</table>\n</html>\n"
    )


def _row(cover: Cover, most: int) -> str:
    name, times, *rest = _cells(cover)
    bar = f'<span class="bar" style="width: {max(2, round(80 * cover.times / most))}px"></span>'
    cells = "".join(f"<td>{escape(cell)}</td>" for cell in rest)
    return f'<tr><td>{escape(name)}</td><td class="n">{bar}{times}</td>{cells}</tr>'
