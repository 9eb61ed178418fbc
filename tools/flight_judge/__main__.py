"""Judges a campaign in the simulator: ``setup/in_ros2 python -m flight_judge CAMPAIGN [--into PAGE [--mark NAME]] [--words FILE]``.

CAMPAIGN is the folder of ``alula campaign``. Each flight is judged by the simulator's truth: no collision, at rest in the end, not hung,
and the cause that was told is one of the faults that were in effect. Beside it stands what the mocks say of the same faults. Verdicts
are written to ``verdicts.jsonl`` in the folder, a table to stdout. Ends with 1 where something is wrong, 2 where there is nothing to judge.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from alula.common.files import json_line, write_text
from flight_judge.mocks import Mocked, Mocks, differs
from flight_judge.truth import Truth, truth_of
from flight_judge.verdicts import Verdict, Words, claim_of, judge, read_words, with_radio

WORDS = Path(__file__).resolve().parents[2] / "tests/campaigns/uav-causes.yaml"
REASON_LETTERS = 110
HEAD = ("run", "scenario, seed", "faults, s after lift-off", "outcome", "true cause", "clearance", "over mocks", "wrong")


@dataclass(frozen=True)
class Judged:
    """A flight with everything that is said of it."""

    row: Mapping[str, Any]
    truth: Truth
    verdict: Verdict
    mocked: Mocked

    def as_dict(self) -> dict[str, object]:
        """Return a line of ``verdicts.jsonl``."""
        row, truth = self.row, self.truth
        told = {"run": row["run"], "scenario": row["scenario"], "seed": row["seed"], "faults": row["faults"], "outcome": row["outcome"]}
        true = {"collisions": truth.collisions, "crash": truth.crash, "min_clearance_m": truth.min_clearance_m, "at_rest": truth.at_rest}
        true["broken"] = [vars(one) for one in truth.broken]
        mocks = {"outcome": self.mocked.outcome, "unknown": self.mocked.unknown}
        return {**told, "truth": true, "cause": self.verdict.cause, "wrong": self.verdict.wrong, "mocks": mocks}

    def cells(self) -> tuple[str, ...]:
        """Return the cells of its line in a table."""
        row, clearance_m = self.row, self.truth.min_clearance_m
        mocks = self.mocked.outcome if differs(row, self.mocked) else "the same"
        mocks += f" without {', '.join(self.mocked.unknown)}" if self.mocked.unknown else ""
        faults = ", ".join(f"`{one}`" for one in row["faults"]) or "none"
        clearance = "-" if clearance_m is None else f"{clearance_m:.2f} m"
        who = f"{row['scenario']}, {row['seed']}"
        return (
            str(row["run"]),
            who,
            faults,
            str(row["outcome"]),
            self.verdict.cause or "-",
            clearance,
            mocks,
            "; ".join(one if len(one) <= REASON_LETTERS else f"{one[:REASON_LETTERS]}..." for one in self.verdict.wrong) or "-",
        )


def judged(campaign: Path, words: Words) -> Iterator[Judged]:
    """Judge each flight whose row is in a campaign's table."""
    plan = json.loads((campaign / "campaign.json").read_text(encoding="utf-8"))
    mocks = Mocks()
    for line in (campaign / "runs.jsonl").read_text(encoding="utf-8").splitlines():
        row = json.loads(line)
        folder = campaign / row["folder"]
        summary = json.loads((folder / "summary.json").read_text(encoding="utf-8")) if (folder / "summary.json").is_file() else {}
        truth = with_radio(truth_of(folder), row["faults"])
        world = campaign / f"world-{row['scenario']}.yaml"
        write_text(world, plan["runs"][row["run"]]["world"] or "")
        mocked = mocks.run(row["scenario"], str(world) if world.stat().st_size else "", row["seed"], row["faults"])
        yield Judged(row, truth, judge(claim_of({**row, **summary}), truth, words), mocked)


def table(flights: Sequence[Judged]) -> str:
    """Return the flights as a Markdown table."""
    rows = [HEAD, ("---",) * len(HEAD), *(one.cells() for one in flights)]
    return "".join(f"| {' | '.join(cell.replace('|', '/') for cell in row)} |\n" for row in rows)


def coverage(flights: Sequence[Judged]) -> str:
    """Return what was really broken, in which ways, how often, and how those flights ended, as a Markdown table."""
    kinds: dict[str, Counter[str]] = {}
    ends: dict[str, Counter[str]] = {}
    for one in flights:
        for what in {broken.what for broken in one.truth.broken}:
            kinds.setdefault(what, Counter()).update({broken.how for broken in one.truth.broken if broken.what == what})
            ends.setdefault(what, Counter()).update([f"{one.row['outcome']}{', wrong' if one.verdict.wrong else ''}"])
    rows = [("broken", "flights, by way", "outcomes"), ("---",) * 3]
    rows += [(what, _listed(kinds[what]), _listed(ends[what])) for what in sorted(kinds)]
    return "".join(f"| {' | '.join(row)} |\n" for row in rows)


def _listed(counted: Counter[str]) -> str:
    return "; ".join(f"{times} {name}" for name, times in counted.most_common())


def counts(flights: Sequence[Judged]) -> str:
    """Return the figures of all flights, in a sentence each."""
    outcomes = ", ".join(f"{times} {name}" for name, times in Counter(str(one.row["outcome"]) for one in flights).most_common())
    wrong = Counter(words.partition(":")[0] for one in flights for words in one.verdict.wrong)
    told = [one for one in flights if one.verdict.cause or any(words.startswith("untrue") for words in one.verdict.wrong)]
    other = sum(differs(one.row, one.mocked) and not one.mocked.unknown for one in flights)
    same = sum(not one.mocked.unknown for one in flights)
    return (
        f"{len(flights)} flights: {outcomes}. A cause was told in {len(told)}, true in {sum(bool(one.verdict.cause) for one in told)}. "
        f"Wrong: {', '.join(f'{times} {name}' for name, times in wrong.most_common()) or 'nothing'}. "
        f"Of {same} flights whose faults the mocks have, {other} ended otherwise.\n"
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Judge; return the exit code."""
    parser = argparse.ArgumentParser(prog="flight_judge", description="Judge the flights of a campaign by the simulator's truth.")
    parser.add_argument("campaign", type=Path, help="the folder of a campaign in the simulator")
    parser.add_argument("--into", type=Path, metavar="PAGE", help="put figures and tables into this page, between its marks")
    parser.add_argument("--mark", default="flights", help="name of the marks, <!-- NAME --> and <!-- /NAME --> (default flights)")
    parser.add_argument("--words", type=Path, default=WORDS, help="what a true reason may name, by fault (default: the drone's)")
    given = parser.parse_args(arguments)
    try:
        flights = list(judged(given.campaign, read_words(given.words)))
    except (OSError, ValueError) as error:
        sys.stderr.write(f"flight_judge: {error}\n")
        return 2
    except KeyError as missing:
        sys.stderr.write(f"flight_judge: {given.campaign}: is no campaign in the simulator: a run has no {missing}\n")
        return 2
    write_text(given.campaign / "verdicts.jsonl", "".join(json_line(one.as_dict()) for one in flights))
    told = f"{counts(flights)}\n{table(flights)}\n{coverage(flights)}"
    sys.stdout.write(told)
    if given.into is not None:
        first, last = f"<!-- {given.mark} -->", f"<!-- /{given.mark} -->"
        before, begin, rest = given.into.read_text(encoding="utf-8").partition(first)
        _, end, after = rest.partition(last)
        if not begin or not end:
            sys.stderr.write(f"flight_judge: {given.into} has no place for the table: add {first} and {last}\n")
            return 2
        write_text(given.into, f"{before}{first}\n\n{told}\n{last}{after}")
    return 1 if any(one.verdict.wrong for one in flights) else 0


if __name__ == "__main__":
    sys.exit(main())
