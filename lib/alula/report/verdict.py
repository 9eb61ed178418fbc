"""The last lines of a run: how it went, in words and numbers, and where the pictures are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from alula.common.robots import page_words
from alula.common.run_log import read_waits
from alula.report.aborts import SIGNAL, TOLD_TO_END, ReportedAbort, read_abort
from alula.report.deaths import Death
from alula.report.phases import home

MEANING = {
    "accomplished": "mission accomplished",
    "degraded": "mission accomplished in degraded mode",
    "given_up": "mission given up",
    "aborted": "mission aborted",
    "not_started": "the mission could not start",
    "served": "skills served, without a mission",
    "running": "the mission's process ended before the mission did",
}
BY_EXIT_CODE = {0: "accomplished", 1: "given_up", 2: "not_started"}
"""Begins the reason of a mission that a signal has ended: who sent it, it can't know."""
PICTURES = (".svg", ".png")


def number(value: float | None, unit: str, digits: int = 2) -> str:
    """Return ``1.23 m``, or ``unknown``."""
    return "unknown" if value is None else f"{value:.{digits}f} {unit}".rstrip()


def came_back(summary: Mapping[str, Any]) -> list[str]:
    """Return whether the robot came back well, in words; nothing of a robot that has no state of departure."""
    words, back = page_words(), summary.get("landed")
    if summary.get("crash"):
        return [f"{words['back']}: no, it crashed: {summary['crash']}"]
    if back is None and home() is None:
        return []
    left = f", {summary['left']}" if summary.get("left") else ""
    return [f"{words['back']}: " + {True: "yes", False: "no", None: f"no {words['departure']} is known"}[back] + left]


def duration_words(summary: Mapping[str, Any]) -> str:
    """Return ``duration 1.0 s``, or that it is unknown."""
    return f"duration {number(summary.get('duration_s'), 's', 1)}"


def was_ended(summary: Mapping[str, Any], ended: ReportedAbort | None) -> bool:
    """Return whether the mission came to no end of its own."""
    outcome, reason = summary.get("outcome"), str(summary.get("reason"))
    told = reason.startswith(TOLD_TO_END) or (ended is not None and reason == ended.sentence())
    return outcome in {None, "running"} or (outcome == "aborted" and told)


def outcome_words(summary: Mapping[str, Any], died: Sequence[Death], out: Path, ended: ReportedAbort | None) -> str:
    """Return how the mission ended, in words; where its files are lost, by the exit code of its process, or by what died."""
    outcome, code, reason = summary.get("outcome"), summary.get("mission_exit"), summary.get("reason")
    if outcome == "aborted" and ended is None and was_ended(summary, ended):
        ended = ReportedAbort(SIGNAL, str(reason))
    if ended is not None and was_ended(summary, ended):
        return f"mission {ended.sentence()}"
    if outcome == "served":
        return f"{MEANING[outcome]}, until the run was told to end: {ended.why if ended else reason}"
    if outcome == "aborted" and str(reason).startswith(outcome):  # as "aborted by the operator" of the page
        return f"mission {reason}"
    if outcome is not None:
        return MEANING.get(str(outcome), f"outcome: {outcome}") + (f": {reason}" if reason else "")
    if code in BY_EXIT_CODE and all(death.again_s is not None for death in died):  # else it may be the supervisor's
        return f"{MEANING[BY_EXIT_CODE[code]]} (by its exit code; its own account is lost)"
    names = ", ".join(dict.fromkeys(death.name for death in died))
    return f"the mission came to no outcome: {f'{names} died' if names else 'the run ended early'}; {out / 'logs'} has the reasons"


def death_lines(died: Sequence[Death]) -> list[str]:
    """Return for each process that died how it ended the last time, whether it was restarted, and how often it died."""
    last = {death.name: death for death in died}
    times = {name: sum(death.name == name for death in died) for name in last}
    return [f"  {one.sentence()}; {one.fate}" + (f" ({times[name]} times in all)" if times[name] > 1 else "") for name, one in last.items()]


def world_lines(summary: Mapping[str, Any]) -> list[str]:
    """Return the figures of a run in a world: duration, distance, clearance, collisions."""
    words, collisions = page_words(), summary.get("collisions")
    return [
        "  "
        + ", ".join([*came_back(summary), duration_words(summary)])
        + (f", {words['moved']} {number(summary['distance_m'], 'm', 1)}" if "distance_m" in summary else "")
        + (f", collisions {'unknown' if collisions is None else collisions}" if "collisions" in summary else "")
        + (f", nearest surface {number(summary['min_clearance_m'], 'm')}" if "min_clearance_m" in summary else ""),
        *figure_lines(summary),
    ]


def figure_lines(summary: Mapping[str, Any]) -> list[str]:
    """Return what the robot measures besides, a line for each group of figures that the summary has: ``map: rmse 0.03 m, ...``."""
    groups: dict[str, list[str]] = {}
    for path, told in page_words()["figures"].items():
        group, _, name = path.rpartition(".")
        values = summary.get(group) or {}
        if values:
            groups.setdefault(group, [])
            value = values.get(name)
            if isinstance(value, str):
                groups[group].append(f"{told['label']} {value}")
            elif value is not None:
                groups[group].append(f"{told['label']} {number(told['factor'] * value, told['unit'], told['digits'])}")
    return [f"  {group}: {', '.join(said) or 'none'}" for group, said in groups.items()]


def task_lines(summary: Mapping[str, Any]) -> list[str]:
    """Return what became of what the mission was sent out for: how much of it is done, and a line for each thing that is not."""
    tasks = summary.get("tasks") or []
    if not tasks:
        return []
    left = [task for task in tasks if not task["done"]]
    told = [f"    {task['name']}: not done" + (f": {task['why']}" if task["why"] else "") for task in left]
    return [f"  {page_words()['tasks']}: {len(tasks) - len(left)} of {len(tasks)} done", *told]


def mock_lines(summary: Mapping[str, Any]) -> list[str]:
    """Return the figures of a run over mocks, which has no world."""
    mock = summary["mock"]
    return [
        f"  {', '.join([*came_back(summary), duration_words(summary)])}; "
        f"over mocks in {number(mock.get('wall_s'), 's')}, {number(mock.get('factor'), 'times faster than the clock', 0)}"
    ]


def what_failed(summary: Mapping[str, Any]) -> str:
    """Return the lines about the recovery."""
    failure_s = summary["recovery"]["failure_s"]
    return next((f"{one['sensor']} {one['told']}" for one in summary["answers"] if one["t_s"] == failure_s), "sensor failed")


def conformance_lines(found: Mapping[str, Any]) -> list[str]:
    """Return the lines about the monitor's verdict."""
    if found["conforms"]:
        return [f"  monitor: all {found['events']} events conform to the models"]
    told = [
        f"{one['skillset']} event {one['sequence']} at {one['stamp_s']:.3f} s: {one['event']}: {one['why']}" for one in found["findings"]
    ]
    return [f"  monitor: does not conform: {one}" for one in told]


def verdict_lines(summary: Mapping[str, Any], died: Sequence[Death], out: Path) -> list[str]:
    """Return the verdict, a line each; who ended the run stands in its folder."""
    ended = read_abort(out)
    lines = ["", outcome_words(summary, died, out, ended), *death_lines(died)]
    if ended is not None and not was_ended(summary, ended) and summary.get("outcome") != "served":
        lines.append(f"  the run was {ended.sentence()}")
    lines += [f"  it still waited for {wait}" for wait, over in read_waits(out).items() if not over]
    if summary.get("mock"):
        lines += mock_lines(summary)
    elif any(summary.get(name) is not None for name in ("landed", "duration_s", "distance_m")):
        lines += world_lines(summary)
    lines += task_lines(summary)
    recovery = summary.get("recovery") or {}
    if recovery.get("failure_s") is not None:
        failure = recovery["failure_s"]
        steps = [f"{what_failed(summary)} at {failure:.2f} s"]
        for key, words in (("detected_s", "detected"), ("fallback_running_s", "fallback running"), ("moving_again_s", "moving again")):
            if recovery.get(key) is not None:
                steps.append(f"{words} {recovery[key] - failure:.2f} s later")
        lines.append("  recovery: " + ", ".join(steps))
    if summary.get("conformance") is not None:
        lines += conformance_lines(summary["conformance"])
    lines += [f"  problem: {problem}" for problem in summary.get("problems") or ()]
    pictures = sorted(path.name for path in out.glob("*") if path.suffix in PICTURES)
    lines += [f"  {out / name}" for name in ("report.html", *pictures, "summary.json") if (out / name).exists()]
    return lines
