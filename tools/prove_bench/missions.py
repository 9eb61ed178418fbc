"""`./alula bench missions [--json FILE] [--svg FILE] [--robot FOLDER]... [--timeout 60]`: how far the search of missions' runs scales.

Looks at all runs of the robots' missions, and of four kinds of missions that grow: fetching objects one after the other, trees of more
and more leaves over more and more skills, a ring of waypoints, and skills of so many skillsets that all run at once. Each in a process
of its own: seconds of the processor, peak memory, how many regions and ticks, and where it stops. A line is printed as soon as it is
measured.
"""

from __future__ import annotations

import argparse
import contextlib
import random
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from alula.check.robot import models_of, part_of
from alula.common.robots import find_robot
from alula.missions.mission_file import MissionFile
from alula.missions.part import NO_PART, MissionPart
from alula.model.expressions import ResourceIs
from alula.model.model import (
    Assignment,
    Effect,
    Interrupt,
    Invariant,
    Precondition,
    Resource,
    Result,
    ResultKind,
    Skill,
    Skillset,
    Transition,
)
from alula.prove.limits import Deadline, OutOfTimeError
from alula.prove.mission.findings import findings
from alula.prove.mission.prover import LOOKED_AT
from alula.prove.mission.regions import Regions
from alula.prove.mission.responses import FailureResponses
from alula.prove.mission.system import System
from growing_bench import Row, measured_apart, peak_mb, tell_row, tell_rows, write_rows
from prove_bench.growth import picture

COMMAND = "alula bench missions"
COLUMNS = "{family:<12}{size:<12}{leaves:>7}{cpu_s:>9}{peak_mb:>9}{regions:>9}{ticks:>9}  {complete}"
MAIN = "main_tree_to_execute="
A_SKILLSET = 5
"""Skills of one skillset, in trees."""
Mission = tuple[list[Skillset], str]
"""Skillsets, and what stands in the tree."""


def fetch(objects: int) -> Mission:
    """Return a robot that fetches so many objects: it goes there, picks up with three attempts, goes back, puts down."""
    hand = Resource("hand", ("Empty", "Full"), "Empty", (Transition("Empty", "Full"), Transition("Full", "Empty")))
    skills = (
        _working("go", "wheels"),
        _working("pick", "arm", Assignment("hand", "Full"), needs=ResourceIs("hand", "Empty")),
        _working("place", "arm", Assignment("hand", "Empty"), needs=ResourceIs("hand", "Full")),
    )
    one = '<r.go/><RetryUntilSuccessful num_attempts="3"><r.pick/></RetryUntilSuccessful><r.go/><r.place/>'
    return [Skillset("r", resources=(hand, _free("wheels"), _free("arm")), skills=skills)], f"<Sequence>{one * objects}</Sequence>"


def tree(leaves: int) -> Mission:
    """Return a tree of so many leaves over a quarter as many skills (5 to 50); five skills of one skillset share a resource."""
    chance = random.Random(leaves)  # noqa: S311 - nothing here is secret
    count = max(5, min(50, leaves // 4))
    names = [(f"s{number // A_SKILLSET}", f"do{number % A_SKILLSET}") for number in range(count)]
    skillsets = [
        Skillset(name, resources=(_free("tool"),), skills=tuple(_working(skill, "tool") for owner, skill in names if owner == name))
        for name in dict.fromkeys(owner for owner, _ in names)
    ]

    def grown(size: int) -> str:
        if size == 1:
            owner, skill = chance.choice(names)
            return f"<{owner}.{skill}/>"
        left = chance.randint(1, size - 1)
        tag = chance.choices(("Sequence", "Fallback", "Parallel"), (5, 4, 1))[0]
        return f"<{tag}>{grown(left)}{grown(size - left)}</{tag}>"

    return skillsets, grown(leaves)


def ring(places: int) -> Mission:
    """Return a robot that goes round and round by so many places, each by a skill of its own."""
    states = tuple(f"P{number}" for number in range(places))
    transitions = tuple(Transition(one, states[(number + 1) % places]) for number, one in enumerate(states))
    skills = tuple(
        _working(f"go{number}", "wheels", Assignment("place", transition.target), needs=ResourceIs("place", transition.source))
        for number, transition in enumerate(transitions)
    )
    legs = "".join(f"<r.go{number}/>" for number in range(places))
    tree_ = f"<KeepRunningUntilFailure><Sequence>{legs}</Sequence></KeepRunningUntilFailure>"
    return [Skillset("r", resources=(Resource("place", states, "P0", transitions), _free("wheels")), skills=skills)], tree_


def at_once(branches: int) -> Mission:
    """Return a mission of so many branches that run at once, each with two skills of a skillset of its own."""
    skillsets = [
        Skillset(f"s{number}", resources=(_free("tool"),), skills=(_working("do", "tool"), _working("mend", "tool")))
        for number in range(branches)
    ]
    inside = "".join(f"<Fallback><{one.name}.do/><{one.name}.mend/></Fallback>" for one in skillsets)
    return skillsets, f'<Parallel failure_count="{branches}">{inside}</Parallel>'


FAMILIES: dict[str, tuple[Callable[[int], Mission], tuple[int, ...]]] = {
    "fetch": (fetch, (1, 2, 5, 10, 20)),
    "tree": (tree, (10, 20, 50, 100, 200)),
    "ring": (ring, (5, 10, 20, 50)),
    "at once": (at_once, (1, 2, 3, 4, 5, 6)),
}
"""Each with its sizes: objects, leaves, places, branches."""


def _free(name: str) -> Resource:
    return Resource(name, ("Free", "Used"), "Free", (Transition("Free", "Used"), Transition("Used", "Free")))


def _working(name: str, tool: str, *done: Assignment, needs: ResourceIs | None = None) -> Skill:
    """Return a skill that takes a tool, and does something when it ends well."""
    give = Effect("give", (Assignment(tool, "Free"),))
    needed = () if needs is None else (Precondition("needs", needs),)
    return Skill(
        name,
        preconditions=(*needed, Precondition("free", ResourceIs(tool, "Free"))),
        start=Effect("take", (Assignment(tool, "Used"),)),
        invariants=(Invariant("holds", ResourceIs(tool, "Used")),),
        interrupt=Interrupt(effect=give),
        results=(
            Result("OK", effect=Effect("done", (*give.assignments, *done)), kind=ResultKind.SUCCESS),
            Result("LOST", effect=give, kind=ResultKind.FAILURE),
        ),
    )


# --- measuring ---------------------------------------------------------------------------------------------------------


def measure(family: str, size: str, timeout_s: float) -> Row:
    """Look at all runs of one mission in this process; of a robot's own mission ``size`` is the file."""
    with tempfile.TemporaryDirectory() as folder:
        if family not in FAMILIES:
            robot = find_robot(Path(size).parent)
            path, models, part = Path(size), models_of(robot, _warn), part_of(robot, _warn)
        else:
            path, part = Path(folder) / "mission.xml", NO_PART
            skillsets, inside = FAMILIES[family][0](int(size))
            models = tuple(skillsets)
            path.write_text(f'<root BTCPP_format="4"><BehaviorTree ID="mission">{inside}</BehaviorTree></root>', encoding="utf-8")
        return {"family": family, "size": size if family in FAMILIES else Path(size).stem, **_looked_at(path, models, part, timeout_s)}


def _warn(line: str) -> None:
    sys.stderr.write(f"{COMMAND}: {line}\n")


def _looked_at(path: Path, models: Sequence[Skillset], part: MissionPart, timeout_s: float) -> Row:
    begin, worked = time.monotonic(), time.process_time()
    deadline = Deadline.after(timeout_s)
    regions = Regions(System.of(MissionFile.read(path, models, part), LOOKED_AT), deadline)
    with contextlib.suppress(OutOfTimeError):
        regions.explore()
    found = findings(regions, FailureResponses(regions))
    return {
        "leaves": len(regions.system.leaves),
        "seconds": round(time.monotonic() - begin, 3),
        "cpu_s": round(time.process_time() - worked, 3),
        "peak_mb": peak_mb(),
        "regions": len(regions.regions),
        "ticks": regions.system.ticker.runs,
        "complete": regions.complete,
        "findings": sorted({finding.code for finding in found}),
    }


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure all; print a table, and write JSON and a picture where they are wanted."""
    options = _parser().parse_args(arguments)
    if options.one:
        family, size = options.one
        return tell_row(measure(family, size, options.timeout))
    rows = tell_rows(COLUMNS, _all(options.robot, options.timeout), complete={True: "yes", False: "no"})
    write_rows(options.json, "missions", rows, timeout_s=options.timeout)
    if options.svg is not None:
        options.svg.write_text(picture([row for row in rows if row["family"] in FAMILIES]), encoding="utf-8")
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog=COMMAND, description="Measure how far the search of missions' runs scales.")
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the figures to this file")
    parser.add_argument("--svg", type=Path, metavar="FILE", help="also draw how it grows")
    parser.add_argument("--robot", type=Path, action="append", default=[], metavar="FOLDER", help="look at the missions of this robot, too")
    parser.add_argument("--timeout", type=float, default=60.0, metavar="SECONDS", help="time limit of each mission (default 60)")
    parser.add_argument("--one", nargs=2, metavar=("FAMILY", "SIZE"), help="measure only this mission, in this process")
    return parser


def _all(robots: Sequence[Path], timeout_s: float) -> Iterator[Row]:
    """Yield a row for each mission, measured in a process of its own; a kind that stops is not tried with more."""
    for robot in robots:
        for path in sorted((robot / "missions").glob("*.xml")):
            if MAIN in path.read_text(encoding="utf-8"):  # else it is a part of others
                yield _apart(find_robot(robot).name, str(path), timeout_s)
    for family, (_, sizes) in FAMILIES.items():
        for size in sizes:
            row = _apart(family, str(size), timeout_s)
            yield row
            if not row["complete"]:
                break


def _apart(family: str, size: str, timeout_s: float) -> Row:
    return measured_apart("prove_bench.missions", "--timeout", str(timeout_s), "--one", family, size)


if __name__ == "__main__":
    sys.exit(main())
