"""`./alula bench prove [--json FILE] [--sizes 10,20,50,100,200] [--timeout 30]`: how far the proofs scale.

Grows three kinds of skillsets by skills, two of them by resources alike, and proves them one situation at a time and as sets,
each in a process of its own: seconds of the clock and of the processor, peak memory, and where it stops. A line is printed as
soon as it is measured.
"""

from __future__ import annotations

import argparse
import random
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from alula.model.expressions import And, Not, ResourceIs, SkillRuns
from alula.model.model import (
    Assignment,
    Effect,
    Interrupt,
    Invariant,
    Precondition,
    Property,
    PropertyKind,
    Resource,
    Result,
    Skill,
    Skillset,
    Transition,
)
from alula.prove.skillset.prover import prove
from growing_bench import Row, measured_apart, peak_mb, tell_row, tell_rows, write_rows

COLUMNS = "{family:<12}{method:<12}{size:>6}{seconds:>10}{cpu_s:>10}{peak_mb:>10}  {proved}"
ALL_ONE_BY_ONE = 10**9
SPARSE_RESOURCES = 60


def tools(count: int) -> Skillset:
    """Return a robot with ``count`` tools: each a resource of its own and a skill that uses it, all under one authority."""
    authority = Resource(
        "authority", ("Pilot", "Drone"), "Pilot", (Transition("Pilot", "Drone", extern=True), Transition("Drone", "Pilot", extern=True))
    )
    skills = tuple(_using(f"use{i}", [f"tool{i}"], ResourceIs("authority", "Drone")) for i in range(count))
    never = Property("obeys", PropertyKind.NEVER, And((SkillRuns("use0"), ResourceIs("authority", "Pilot"))))
    ends = Property("ends", PropertyKind.LEADS_TO, SkillRuns("use0"), ResourceIs("tool0", "Free"), fair=True)
    return Skillset(
        "tools", resources=(authority, *(_free_or_used(f"tool{i}") for i in range(count))), skills=skills, properties=(never, ends)
    )


def neighbours(count: int) -> Skillset:
    """Return a ring of ``count`` resources and as many skills that each need two neighbours of it."""
    skills = tuple(_using(f"join{i}", [f"part{i}", f"part{(i + 1) % count}"]) for i in range(count))
    both = Property("apart", PropertyKind.NEVER, And((SkillRuns("join0"), SkillRuns("join1"))))
    return Skillset("neighbours", resources=tuple(_free_or_used(f"part{i}") for i in range(count)), skills=skills, properties=(both,))


def sparse(count: int) -> Skillset:
    """Return skills that each use three of at most sixty resources: one is taken, two at random must be free and stay so."""
    chance = random.Random(count)  # noqa: S311 - nothing here is secret
    names = [f"part{i}" for i in range(max(3, min(count, SPARSE_RESOURCES)))]
    taken = [names[i % len(names)] for i in range(count)]
    skills = tuple(_taking(f"use{i}", one, *chance.sample([n for n in names if n != one], 2)) for i, one in enumerate(taken))
    alone = Property("alone", PropertyKind.NEVER, And((SkillRuns("use0"), Not(ResourceIs(taken[0], "Used")))))
    ends = Property("ends", PropertyKind.LEADS_TO, SkillRuns("use0"), ResourceIs(taken[0], "Free"), fair=True)
    return Skillset("sparse", resources=tuple(map(_free_or_used, names)), skills=skills, properties=(alone, ends))


def _taking(name: str, mine: str, *others: str) -> Skill:
    free = tuple(Precondition(f"{one}_is_free", ResourceIs(one, "Free")) for one in others)
    skill = _using(name, [mine])
    stay = Invariant("stay_free", And(tuple(ResourceIs(one, "Free") for one in others)), skill.interrupt.effect)
    return replace(skill, preconditions=(*free, *skill.preconditions), invariants=(stay, *skill.invariants))


FAMILIES = {"tools": tools, "neighbours": neighbours, "sparse": sparse}
METHODS = {"one by one": ALL_ONE_BY_ONE, "sets": 0}


def _free_or_used(name: str) -> Resource:
    return Resource(name, ("Free", "Used"), "Free", (Transition("Free", "Used"), Transition("Used", "Free")))


def _using(name: str, resources: Sequence[str], needs: ResourceIs | None = None) -> Skill:
    take = Effect("take", tuple(Assignment(one, "Used") for one in resources))
    give = Effect("give", tuple(Assignment(one, "Free") for one in resources))
    needed = () if needs is None else (Precondition("needs", needs),)
    kept = () if needs is None else (Invariant("keeps", needs, give),)
    free = tuple(Precondition(f"free_{one}", ResourceIs(one, "Free")) for one in resources)
    held = tuple(Invariant(f"holds_{one}", ResourceIs(one, "Used")) for one in resources)
    return Skill(
        name,
        preconditions=(*needed, *free),
        start=take,
        invariants=(*kept, *held),
        interrupt=Interrupt(effect=give),
        results=(Result("OK", effect=give),),
    )


def measure(family: str, count: int, method: str, timeout_s: float) -> Row:
    """Prove one skillset in this process."""
    begin, worked = time.monotonic(), time.process_time()
    findings = prove(FAMILIES[family](count), timeout_s=timeout_s, most=METHODS[method])
    seconds, cpu_s = time.monotonic() - begin, time.process_time() - worked
    return {
        "family": family,
        "size": count,
        "method": method,
        "seconds": round(seconds, 3),
        "cpu_s": round(cpu_s, 3),
        "peak_mb": peak_mb(),
        "proved": not any(finding.code == "ALU540" for finding in findings),
        "findings": sorted({finding.code for finding in findings}),
    }


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure all sizes until a method stops; print a table, and write JSON where it is wanted."""
    options = _parser().parse_args(arguments)
    if options.one:
        family, size, method = options.one
        return tell_row(measure(family, int(size), method, options.timeout))
    rows = tell_rows(COLUMNS, _all(options.sizes, options.timeout), proved={True: "yes", False: "no"})
    write_rows(options.json, "proofs", rows, timeout_s=options.timeout)
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="alula bench prove", description="Measure how far the proofs of skillsets scale.")
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the figures to this file")
    parser.add_argument("--sizes", type=_sizes, default=_sizes("10,20,50,100,200"), help="numbers of skills")
    parser.add_argument("--timeout", type=float, default=30.0, metavar="SECONDS", help="time limit of each proof (default 30)")
    parser.add_argument("--one", nargs=3, metavar=("FAMILY", "SIZE", "METHOD"), help="measure only this skillset, in this process")
    return parser


def _sizes(text: str) -> list[int]:
    return [int(size) for size in text.split(",")]


def _all(sizes: Sequence[int], timeout_s: float) -> Iterator[Row]:
    """Yield a row for each size, each measured in a process of its own; a method that stops is not tried with more."""
    for family in FAMILIES:
        for method in METHODS:
            for size in sizes:
                row = measured_apart("prove_bench.skillsets", "--timeout", str(timeout_s), "--one", family, str(size), method)
                yield row
                if not row["proved"]:
                    break


if __name__ == "__main__":
    sys.exit(main())
