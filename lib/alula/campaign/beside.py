"""Compare how the missions of a campaign reacted to each failure with all reactions that the search of their runs proves possible.

A flown response that the proof does not know is an error of one of them.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from alula.campaign.flown import FlownResponse
from alula.campaign.proved import Asked, Key, ProvedMission, ProvedResponse
from alula.missions.director import Outcome
from alula.prove.mission.system import FAILED
from alula.records.tree import Path, Places

Row = Mapping[str, Any]
PROVED_OUTCOMES = frozenset(one.value for one in (Outcome.ACCOMPLISHED, Outcome.DEGRADED, Outcome.GIVEN_UP))
"""Other ends are none of the mission's own: it was aborted, or never over."""
NOTHING = "nothing more"
"""The mission ends, and asks for no skill any more."""


@dataclass(frozen=True)
class Flown:
    """A reaction as it was flown: the skills requested and the outcome; ``runs`` has the number of each such run, once for each time."""

    asked: Asked
    outcome: str
    end: str
    """What the failed execution ended with."""
    fault: str
    """That it follows from; empty: none of those that the run was asked for."""
    known: bool
    """The proof has it."""
    runs: list[int] = field(default_factory=list)


@dataclass
class Beside:
    """A failure at a moment, with the proved and the flown reactions; ``proved`` None: the search found no such failure then."""

    key: Key
    skill: str
    proved: ProvedResponse | None
    leaf: str = ""
    """The name of the leaf that fails, of several by one name with the branch that it is in."""
    flown: list[Flown] = field(default_factory=list)

    @property
    def place(self) -> Path:
        """The leaf that fails."""
        return self.key[0]

    @property
    def moment(self) -> Path:
        """The other skills whose leaves run."""
        return self.key[2]

    @property
    def times(self) -> int:
        """How often it was flown."""
        return sum(len(one.runs) for one in self.flown)

    @property
    def end(self) -> str:
        """How the skill ends, in words: by name where the tree distinguishes it."""
        return "fails" if self.key[1] == FAILED else self.key[1]

    @property
    def asked(self) -> Counter[str]:
        """The skills requested, in words, each with its count."""
        return self._counted((words_of(self.place, one.asked), one) for one in self.flown)

    @property
    def outcomes(self) -> Counter[str]:
        """How the missions ended, and how often."""
        return self._counted((one.outcome, one) for one in self.flown)

    @property
    def faults(self) -> Counter[str]:
        """The faults that it followed from, and how often."""
        return self._counted((one.fault, one) for one in self.flown if one.fault)

    @property
    def can_ask(self) -> list[str]:
        """The reactions that the tree can show, in words."""
        can = {words_of(self.place, one) for one in self.proved.asked} if self.proved else set()
        return sorted(can, key=lambda words: (words == NOTHING, words))

    @staticmethod
    def _counted(found: Iterable[tuple[str, Flown]]) -> Counter[str]:
        counted: Counter[str] = Counter()
        for name, one in found:
            counted[name] += len(one.runs)
        return counted

    def as_dict(self) -> dict[str, object]:
        """Return the row in the form of ``coverage.json``."""
        one = self.proved
        can = {"asks": self.can_ask, "outcomes": sorted(one.outcomes), "ends": list(one.ends), "faults": list(one.faults)} if one else None
        did = {"times": self.times, "asks": dict(self.asked), "outcomes": dict(self.outcomes), "faults": dict(self.faults)}
        head = {"skill": self.skill, "end": self.key[1], "node": list(self.place), "while": list(self.moment)}
        return {**head, "proved": can, "flown": did}


@dataclass(frozen=True)
class MissionResponses:
    """The proved and flown reactions of a scenario's mission; ``unproved``: why the proof is incomplete."""

    scenario: str
    rows: Sequence[Beside]
    unproved: str = ""

    @property
    def flown(self) -> int:
        """How many of the proved rows were flown."""
        return sum(1 for one in self.rows if one.proved and one.times)

    @property
    def unknown(self) -> list[str]:
        """Each flown reaction that the proof does not have, one line each; empty where the proof is incomplete."""
        wrong = [(row, one) for row in self.rows for one in row.flown if not one.known]
        return [] if self.unproved else [_line(self.scenario, row, one) for row, one in wrong]

    def as_dict(self) -> dict[str, object]:
        """Return the comparison in the form of ``coverage.json``."""
        rows = [row.as_dict() for row in self.rows]
        return {"scenario": self.scenario, "unproved": self.unproved, "unknown": self.unknown, "rows": rows}


def beside(scenario: str, mission: ProvedMission, rows: Iterable[Row]) -> MissionResponses:
    """Compare the flown reactions of a scenario's runs with the proved ones."""
    found = {key: Beside(key, one.skill, one) for key, one in mission.responses.items()}
    flown: dict[tuple[Key, Asked, str, str, str], Flown] = {}
    for row in rows:
        for one in map(FlownResponse.read, row["answers"] if row["outcome"] in PROVED_OUTCOMES else ()):
            key, asked, outcome = mission.key(one.place, (one.state, one.result), one.moment), frozenset(one.asked), str(row["outcome"])
            proved = mission.responses.get(key)
            known = proved is not None and asked in proved.asked and outcome in proved.outcomes
            beside_it = found.setdefault(key, Beside(key, one.skill, proved))
            fault = next(str(told["fault"]) for told in row["answers"] if told["id"] == one.id)
            end = one.result or one.state
            same = (key, asked, outcome, end, fault)
            if same not in flown:
                flown[same] = Flown(asked, outcome, end, fault, known)
                beside_it.flown.append(flown[same])
            flown[same].runs.append(int(row["run"]))
    for failure in found.values():
        failure.leaf = _leaf(failure.place, {key[0] for key in found})
    return MissionResponses(
        scenario, sorted(found.values(), key=lambda one: (one.skill, one.place, one.key[1], one.moment)), mission.unproved
    )


def _leaf(place: Path, places: Iterable[Path]) -> str:
    others = [one for one in places if one[-1] == place[-1] and one != place]
    branches = {place[at] for other in others for at in range(len(place)) if at >= len(other) or other[at] != place[at]}
    first = next((name for name in place[:-1] if name in branches), "")
    return f"'{place[-1]}' of '{first}'" if first else f"'{place[-1]}'"


def words_of(failed: Path, asked: Asked) -> str:
    """Return a reaction in words: the branch of the tree that takes over, and the leaves whose skills it requests."""
    if not asked:
        return NOTHING
    first = min(asked)
    branch = Places({"failed": failed, "asked": first}).response("failed", "asked")
    leaves = " and ".join(sorted(f"'{place[-1]}'" for place in asked))
    return leaves if branch in {"", first[-1]} else f"{branch}: {leaves}"


def _line(scenario: str, row: Beside, one: Flown) -> str:
    """Return a flown response that the proof does not know: fault, moment, what was flown, what is proved."""
    by = f", by the fault {one.fault}" if one.fault else ""
    meanwhile = f" while {', '.join(row.moment)} ran" if row.moment else ""
    what = f"{scenario}, run {one.runs[0]}: {row.leaf} ({row.skill}) ended with {one.end}{by}{meanwhile}"
    times = f", {len(one.runs)} times" if len(one.runs) > 1 else ""
    can = f"{' or '.join(row.can_ask)}, then {' or '.join(sorted(row.proved.outcomes))}" if row.proved else "it can't fail so then"
    return f"{what}; flown: {words_of(row.place, one.asked)}, then {one.outcome}{times}; proved: {can}"
