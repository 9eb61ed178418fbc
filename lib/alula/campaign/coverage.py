"""The failure coverage of a campaign: each way to fail with the mission's responses and their delays, and the ways never tried."""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

from alula.campaign.beside import MissionResponses
from alula.campaign.failures import FAULT, KINDS, Way, name_of
from alula.common.faults import parse_fault
from alula.common.robots import find_robot
from alula.common.scenarios import Scenario
from alula.missions.director import EXIT_CODES

Row = Mapping[str, Any]
CODE_OF = {outcome.value: code for outcome, code in EXIT_CODES.items()}
"""How ``alula run`` ends, by a row's outcome."""
_INCLUDED = re.compile(r"\$\(find (\w+)\)/launch/([\w.]+\.launch)")


@dataclass
class Cover:
    """The runs in which one way to fail occurred. ``responses`` counts the branches that took over; clearances are those of whole runs."""

    way: Way
    responses: Counter[str] = field(default_factory=Counter)
    outcomes: Counter[str] = field(default_factory=Counter)
    worst_after_s: float | None = None
    worst_clearance_m: float | None = None

    @property
    def times(self) -> int:
        """How often it happened."""
        return self.responses.total()

    def as_dict(self) -> dict[str, object]:
        """Return the row in the form of ``coverage.json``: recovery in seconds, clearance in metres."""
        found = {"kind": self.way.kind, "name": self.way.name, "times": self.times, "answers": dict(self.responses.most_common())}
        worst = {"worst_recovery_s": self.worst_after_s, "worst_clearance_m": self.worst_clearance_m}
        return {**found, "outcomes": dict(self.outcomes.most_common()), **worst}


@dataclass(frozen=True)
class Coverage:
    """The coverage matrix, and the runs that it summarizes."""

    covers: Sequence[Cover]
    runs: int
    outcomes: Mapping[str, int]
    troubled: Sequence[int]
    """Runs that did not come to an end or conform, left something open, collided, did not land, had problems, or an exit code that
    does not say their outcome."""
    responses: Sequence[MissionResponses] = ()
    """Of each mission, flown beside proved."""
    again: Mapping[int, str] = field(default_factory=dict)
    """What a run with trouble was asked for, in the words of ``alula run``: its scenario, its own seed, its faults."""

    @property
    def unknown(self) -> list[str]:
        """Each flown reaction that the proof of its mission does not have, one line each."""
        return [line for mission in self.responses for line in mission.unknown]

    @property
    def never(self) -> list[Way]:
        """The ways to fail that no run has tried."""
        return [cover.way for cover in self.covers if not cover.times]

    def as_dict(self) -> dict[str, object]:
        """Return the whole matrix in the form of ``coverage.json``."""
        tried = [cover.as_dict() for cover in self.covers if cover.times]
        never = [vars(way) for way in self.never]
        responses = [mission.as_dict() for mission in self.responses]
        whole = {"runs": self.runs, "outcomes": dict(self.outcomes), "troubled": list(self.troubled), "again": dict(self.again)}
        return {**whole, "tried": tried, "never": never, "answers": responses}


def cover(rows: Iterable[Row], ways: Iterable[Way], responses: Sequence[MissionResponses] = ()) -> Coverage:
    """Count the outcomes of each way to fail; ``responses`` are the reactions of the same runs, compared with the proved ones."""
    covers = {way: Cover(way) for way in ways}
    outcomes: Counter[str] = Counter()
    troubled: list[int] = []
    again: dict[int, str] = {}
    runs = 0
    for row in rows:
        runs += 1
        outcomes[str(row["outcome"])] += 1
        if is_troubled(row):
            troubled.append(int(row["run"]))
            again[troubled[-1]] = " ".join(
                [str(row["scenario"]), f"--seed {row.get('seed', 0)}", *(f"--fail {fault}" for fault in row["faults"])]
            )
        for asked in row["faults"]:  # one that never came, because the run was over before, has not been tried
            way = Way(FAULT, name_of(parse_fault(asked)))
            covers.setdefault(way, Cover(way))
        for failure in row["failures"]:
            way = Way(failure["kind"], failure["name"])
            _count(covers.setdefault(way, Cover(way)), row, str(failure["answered_by"]), failure["after_s"])
    ordered = sorted(covers.values(), key=lambda one: (KINDS.index(one.way.kind), one.way.name))
    return Coverage(ordered, runs, dict(outcomes.most_common()), troubled, responses, again)


def is_troubled(row: Row) -> bool:
    """Return whether a run has a defect that no failure excuses: unfinished, open executions, collision, wrong exit code, and the like."""
    unfinished = row["outcome"] in {"not_started", "running", None}
    wrong = row["open"] or row["collisions"] or row["landed"] is False or row["problems"]
    return bool(unfinished or wrong or not row["conforms"] or row["exit_code"] not in {None, CODE_OF.get(str(row["outcome"]))})


def _count(one: Cover, row: Row, response: str, after_s: float | None) -> None:
    one.responses[response] += 1
    one.outcomes[str(row["outcome"])] += 1
    if after_s is not None:
        one.worst_after_s = max(after_s, one.worst_after_s or 0.0)
    clearance_m = row["min_clearance_m"]
    if clearance_m is not None:
        one.worst_clearance_m = clearance_m if one.worst_clearance_m is None else min(clearance_m, one.worst_clearance_m)


def processes(scenarios: Iterable[Scenario]) -> list[str]:
    """Return the names of the processes of a run, as the launch files start them, without the recorder."""
    nodes = (node.get("name", "") for file in launch_files(scenarios) for node in ET.parse(file).iter("node"))  # noqa: S314 - our own
    return sorted({name for name in nodes if name and name != "record" and "$" not in name})


def launch_files(scenarios: Iterable[Scenario]) -> list[Path]:
    """Return the launch files of scenarios and those that they include, from the packages of the robot and of the installation."""
    installed = [Path(os.environ["ALULA_ROOT"]) / "ros1_ws/src"] if "ALULA_ROOT" in os.environ else []
    places = [*find_robot().ros1.packages, *installed]
    named = [(package, file) for package, _, file in (scenario.launch.partition("/") for scenario in scenarios)]
    found: dict[tuple[str, str], Path] = {}
    while named:
        package, file = named.pop()
        path = next((path for place in places if (path := place / package / "launch" / file).is_file()), None)
        if path is not None and (package, file) not in found:
            found[package, file] = path
            named += _INCLUDED.findall(path.read_text(encoding="utf-8"))
    return [found[name] for name in sorted(found)]
