"""The coverage as text and as a page."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from html import escape
from itertools import groupby, zip_longest

from alula.campaign.beside import Beside, MissionResponses
from alula.campaign.coverage import Cover, Coverage

_STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; margin: 2rem auto; max-width: 76rem; padding: 0 1rem; color: #1b2430; background: #fff }
h1 { font-size: 1.4rem } h2 { font-size: 1.05rem; margin-top: 1.8rem }
table { border-collapse: collapse; width: 100% }
th, td { text-align: left; vertical-align: top; padding: .3rem .6rem; border-bottom: 1px solid #d9dfe6 }
td.n, th.n { text-align: right; font-variant-numeric: tabular-nums } tr.never td { color: #6b7786; background: #fbf3e6 }
.bar { display: inline-block; height: .6rem; background: #3b7dd8; margin-right: .4rem; vertical-align: baseline }
.answers { font-size: .9rem } .answers td { border-bottom: 0; padding-top: .15rem; padding-bottom: .15rem }
.answers tbody { border-bottom: 1px solid #d9dfe6 } .answers thead th { border-bottom-color: #8a97a6 }
.answers .proved { background: #f3f7fc; border-left: 1px solid #d9dfe6 } .answers .flown { background: #f5faf3 }
.answers td.moment, .answers td.moment ~ td { border-top: 1px solid #d9dfe6 }
.answers .n { min-width: 3.2rem } .answers .leaf { min-width: 13rem }
.small { color: #6b7786; font-size: .82rem } tr.quiet td:not(.leaf), td.quiet { color: #6b7786 }
.wrong, .answers td.wrong { color: #a3161f; background: #fdecec } p.wrong { padding: .4rem .7rem; border-left: 3px solid #a3161f }
"""
_HEAD = ("way to fail", "times", "response", "outcomes", "worst recovery", "worst clearance")
_NOT_PROVED = "not proved"
_ALL_KNOWN = "Each flown response is one of the proved ones."


def counted(names: Mapping[str, int]) -> str:
    """Return names with their counts, as ``12 navigation.hover, 3 no skill``."""
    return ", ".join(f"{times} {name}" for name, times in names.items())


def shown(value: float | None, unit: str) -> str:
    """Return a number with its unit, or a dash."""
    return "-" if value is None else f"{value:.2f} {unit}"


def _cells(cover: Cover) -> tuple[str, ...]:
    responses, outcomes = dict(cover.responses.most_common()), dict(cover.outcomes.most_common())
    worst = shown(cover.worst_after_s, "s"), shown(cover.worst_clearance_m, "m")
    return f"{cover.way.kind}: {cover.way.name}", str(cover.times), counted(responses), counted(outcomes), *worst


def as_text(coverage: Coverage) -> str:
    """Return the matrix as lines: first what was tried, then what never was, then what was flown beside what is proved."""
    tried = [_HEAD, *(_cells(cover) for cover in coverage.covers if cover.times)]
    widths = [min(60, max(len(row[column]) for row in tried)) for column in range(len(_HEAD))]
    lines = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in tried]
    lines += ["", f"never tried ({len(coverage.never)}):", *(f"  {way.kind}: {way.name}" for way in coverage.never)]
    for mission in coverage.responses:
        lines += ["", *_responses_as_text(mission)]
    troubled = ", ".join(map(str, coverage.troubled[:20])) + (", ..." if len(coverage.troubled) > 20 else "")
    lines += ["", f"{coverage.runs} runs: {counted(dict(coverage.outcomes))}"]
    lines += [f"runs with trouble: {len(coverage.troubled)}{f' ({troubled})' if troubled else ''}"]
    lines += [f"  {run}: alula run {words}" for run, words in list(coverage.again.items())[:20]]
    return "\n".join(lines) + "\n"


def _responses_as_text(mission: MissionResponses) -> list[str]:
    lines = [f"{mission.scenario}, flown beside proved: {_summary(mission)}"]
    for row in (one for one in mission.rows if one.times):
        meanwhile = f" while {', '.join(row.moment)} ran" if row.moment else ""
        can = f"{', '.join(row.can_ask)}; then {', '.join(sorted(row.proved.outcomes))}" if row.proved else _NOT_PROVED
        lines += [f"  {row.leaf} ({row.skill}) {_ends(row)}{meanwhile}"]
        lines += [f"    proved  {can}", f"    flown   {counted(row.asked)}; then {counted(row.outcomes)}"]
    return lines


def _summary(mission: MissionResponses) -> str:
    proved = sum(1 for row in mission.rows if row.proved)
    how = mission.unproved or "all runs were looked at"
    return f"{proved} failures at a moment, {mission.flown} of them flown; {how}"


def _ends(row: Beside) -> str:
    return "fails" if row.end == "fails" else f"ends with {row.end}"


# --- the page ----------------------------------------------------------------------------------------------------------


def as_page(coverage: Coverage, title: str) -> str:
    """Return the matrix as one page of HTML that needs no other file."""
    most = max((cover.times for cover in coverage.covers), default=1) or 1
    head = "".join(f"<th{' class=n' if name == 'times' else ''}>{name}</th>" for name in _HEAD)
    rows = [_row(cover, most) for cover in coverage.covers if cover.times]
    never = [f'<tr class="never"><td colspan="6">{escape(way.kind)}: {escape(way.name)}</td></tr>' for way in coverage.never]
    troubled = ", ".join(map(str, coverage.troubled)) or "none"
    again = "".join(f"<li>{run}: <code>alula run {escape(words)}</code></li>" for run, words in coverage.again.items())
    responses = "\n".join(map(_responses, coverage.responses))
    return (
        f'<!doctype html>\n<html lang="en"><meta charset="utf-8"><title>{escape(title)}</title><style>{_STYLE}</style>\n'
        f"<h1>{escape(title)}</h1>\n<p>{coverage.runs} runs: {escape(counted(dict(coverage.outcomes)))}. "
        f"Runs with trouble: {escape(troubled)}.</p>\n{f'<ul>{again}</ul>' if again else ''}\n"
        f"<h2>What failed, and the mission's responses</h2>\n<table><tr>{head}</tr>\n{chr(10).join(rows)}</table>\n{responses}"
        f"<h2>Never tried ({len(never)})</h2>\n<table>{chr(10).join(never)}</table>\n</html>\n"
    )


def _row(cover: Cover, most: int) -> str:
    name, times, *rest = _cells(cover)
    bar = f'<span class="bar" style="width: {max(2, round(80 * cover.times / most))}px"></span>'
    cells = "".join(f"<td>{escape(cell)}</td>" for cell in rest)
    return f'<tr><td>{escape(name)}</td><td class="n">{bar}{times}</td>{cells}</tr>'


def _responses(mission: MissionResponses) -> str:
    """Return a mission's table: what its tree can do about each failure at a moment, and how often it did."""
    wrong = "".join(f'<p class="wrong">{escape(line)}</p>\n' for line in mission.unknown)
    known = "" if wrong or mission.unproved else f" {_ALL_KNOWN}"
    head = (
        '<thead><tr><th class="leaf">failure</th><th>while these run</th>'
        '<th class="proved">proved: it asks for</th><th class="n flown">flown</th>'
        '<th class="proved">proved: it ends</th><th class="n flown">flown</th></tr></thead>'
    )
    unknown = "" if mission.unproved else "wrong"
    bodies = "\n".join(_body(list(rows), unknown) for _, rows in groupby(mission.rows, key=lambda row: row.key[:2]))
    return (
        f"<h2>{escape(mission.scenario)}: responses to failures, flown beside proved</h2>\n"
        f"<p>{escape(_summary(mission))}.{known}</p>\n{wrong}"
        f'<table class="answers">{head}\n{bodies}</table>\n'
    )


def _body(rows: Sequence[Beside], unknown: str) -> str:
    """Return a failure: for each moment a line for each response, one for each end; ``unknown`` is the look of what is not proved."""
    lines = [_moment(row, unknown) for row in rows]
    row = rows[0]
    proved = next((one.proved for one in rows if one.proved), None)
    flown = sum((one.faults for one in rows), Counter[str]())
    small = (
        [", ".join(proved.ends) if row.end == "fails" else "", f"faults: {', '.join(proved.faults)}" if proved.faults else ""]
        if proved
        else []
    )
    small += [f"flown: {counted(flown)}"] if flown else []
    more = "".join(f'<div class="small">{escape(text)}</div>' for text in small if text)
    leaf = f"<b>{escape(row.leaf)}</b> {escape(_ends(row))}<div>{escape(row.skill)}</div>{more}"
    first = f'<td class="leaf{"" if any(one.times for one in rows) else " quiet"}" rowspan="{sum(map(len, lines))}">{leaf}</td>'
    quiet = [f"<tr{'' if one.times else ' class=quiet'}>" for one, several in zip(rows, lines, strict=True) for _ in several]
    cells = [line for several in lines for line in several]
    return (
        "<tbody>"
        + "".join(f"{tr}{'' if at else first}{line}</tr>" for at, (tr, line) in enumerate(zip(quiet, cells, strict=True)))
        + "</tbody>"
    )


def _moment(row: Beside, unknown: str) -> list[str]:
    """Return the cells of a moment, a text for each line."""
    asks = _lines(row.can_ask, row.asked, unknown)
    ends = _lines(sorted(row.proved.outcomes) if row.proved else [], row.outcomes, unknown)
    pairs = list(zip_longest(asks, ends, fillvalue=_EMPTY))
    moment = f'<td class="moment" rowspan="{len(pairs)}">{"<br>".join(map(escape, row.moment)) or "nothing else"}</td>'
    return [f"{'' if at else moment}{ask}{end}" for at, (ask, end) in enumerate(pairs)]


_EMPTY = '<td class="proved"></td><td class="n flown"></td>'


def _lines(proved: Sequence[str], flown: Counter[str], unknown: str) -> list[str]:
    """Return two cells for each thing that can come, and for each that came and is not proved."""
    cells = [f'<td class="proved">{escape(name)}</td><td class="n flown">{flown[name] or ""}</td>' for name in proved]
    more = [name for name in flown if name not in proved]
    one = f'<td class="proved {unknown}">{_NOT_PROVED}: '
    return cells + [f'{one}{escape(name)}</td><td class="n flown {unknown}">{flown[name]}</td>' for name in more]
