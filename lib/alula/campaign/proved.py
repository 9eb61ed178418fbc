"""All reactions of a mission's tree to each failure, from the search of its runs; flown reactions are compared with them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase

from alula.common.robots import RobotError, find_robot
from alula.common.scenarios import Scenario
from alula.missions.mission_file import MissionFile
from alula.missions.part import NO_PART
from alula.missions.plan import InputError
from alula.missions.scenario import flown
from alula.missions.treeview import path_of
from alula.model.breaking import can_break
from alula.model.execution_state import ExecutionState as S
from alula.model.expressions import Expression
from alula.model.model import Invariant, Precondition, Skillset, Transition
from alula.prove.limits import Deadline, OutOfTimeError
from alula.prove.mission.managers import Failures
from alula.prove.mission.oracle import UndecidedError
from alula.prove.mission.regions import Regions
from alula.prove.mission.responses import FailureResponses, Row
from alula.prove.mission.system import System, look_at
from alula.records.causes.effects import EffectsByFault
from alula.records.tree import Path

LOOKED_AT = Failures(aborts=False)
"""What can happen in a campaign: hooks may refuse and raise, too; nobody aborts, and processes of managers that die are not compared."""
"""The default time of the search, seconds of wall clock."""
End = tuple[str, str]
"""State and result of an execution."""
Asked = frozenset[Path]
"""The places of leaves that are asked for at once."""


@dataclass(frozen=True)
class ProvedResponse:
    """All reactions of the tree to a failure at a moment.

    Attributes:
        place: of the leaf that fails.
        skill: ``skillset.skill``.
        end: as far as the tree can tell: a result, precondition or invariant; FAILED: one of those that it does not tell apart.
        ends: the names of those.
        moment: the other skills whose leaves run, asked for.
        faults: that can bring it about, by the robot's `faults.yaml`.
        asked: all that it can ask for at once; an empty set where the mission ends without.
        outcomes: all ways in which the mission can end from there.
    """

    place: Path
    skill: str
    end: str
    ends: tuple[str, ...]
    moment: Path
    faults: tuple[str, ...]
    asked: frozenset[Asked]
    outcomes: frozenset[str]


Key = tuple[Path, str, Path]
"""Leaf, end as the tree sees it, moment."""


@dataclass(frozen=True)
class ProvedMission:
    """The proved reactions of a mission, by leaf, end and moment; ``unproved``: why some, or all, are missing."""

    responses: Mapping[Key, ProvedResponse] = field(default_factory=dict)
    unproved: str = ""
    seen: Mapping[tuple[Path, End], str] = field(default_factory=dict)
    """As what the tree sees each end of a leaf."""

    def key(self, place: Path, end: End, moment: Path) -> Key:
        """Return the key under which the reaction to a failure is stored."""
        return place, self.seen.get((place, end), end[1] or end[0]), moment


def proved(
    scenario: Scenario, models: Sequence[Skillset], effects: EffectsByFault, on_progress: Callable[[str], None], time_s: float
) -> ProvedMission:
    """Search all runs of a scenario's mission within a time; ``on_progress`` gets the progress of a long search."""
    if not scenario.mission.endswith(".xml"):
        return ProvedMission(unproved=f"{scenario.mission} is no file of a tree")
    deadline = Deadline.after(time_s, on_progress)
    try:
        robot = find_robot()
        source = flown(robot.root / scenario.mission, scenario)
        mission = MissionFile.read(source, models, robot.part("missions") or NO_PART)
        regions, unproved = look_at(
            lambda why: System.of(mission, LOOKED_AT, why_any_order=why),
            lambda system: _explored(Regions(system, deadline), time_s),
        )
    except (UndecidedError, InputError, RobotError) as error:
        return ProvedMission(unproved=f"its runs can't be looked at: {error}")
    except OutOfTimeError:
        return ProvedMission(unproved=_bound(time_s))
    found: dict[Key, ProvedResponse] = {}
    system = regions.system
    for row in FailureResponses(regions).rows:
        one = _response(system, row, effects)
        known = found.get((one.place, one.end, one.moment))
        found[one.place, one.end, one.moment] = one if known is None else _both(known, one)
    seen = {}
    for leaf, node in enumerate(system.leaves):
        for end in _ends(system, leaf):
            state, result = system.told_end(leaf, end)
            seen[path_of(node), end] = result or state
    return ProvedMission(found, unproved, seen)


def _explored(regions: Regions, time_s: float) -> tuple[Regions, str]:
    """Find all regions; return them, and why there may be more."""
    try:
        regions.explore()
    except OutOfTimeError:
        return regions, _bound(time_s)
    return regions, ""


def _bound(time_s: float) -> str:
    return f"not all runs were looked at in {time_s:g} s"


def _both(one: ProvedResponse, other: ProvedResponse) -> ProvedResponse:
    """Return the union of the responses of two leaves whose names give them one place."""
    asked, outcomes = one.asked | other.asked, one.outcomes | other.outcomes
    return ProvedResponse(one.place, one.skill, one.end, one.ends, one.moment, one.faults, asked, outcomes)


def _response(system: System, row: Row, effects: EffectsByFault) -> ProvedResponse:
    places = [path_of(node) for node in system.leaves]
    same = [end for end in _ends(system, row.leaf) if (told := system.told_end(row.leaf, end)) and (told[1] or told[0]) == row.end]
    names = tuple(dict.fromkeys(result or state for state, result in same if state != S.INTERRUPTED.value))
    faults = tuple(name for name in sorted(effects.known) if any(_brings(system, row, effects, name, end) for end in same))
    asked = frozenset(frozenset(places[leaf] for leaf in one) for one in row.asks)
    return ProvedResponse(places[row.leaf], row.skill, row.end, names, row.moment, faults, asked, frozenset(row.outcomes))


def _ends(system: System, leaf: int) -> Iterator[End]:
    """Yield all ends of a leaf's skill that are failures to it."""
    node = system.leaves[leaf]
    skill = node.model
    yield from ((S.TERMINATED.value, one.name) for one in skill.results if one.name not in node.leaf.success)
    yield from ((S.RESOURCE_INVARIANT_VIOLATED.value, one.name) for one in skill.invariants)
    yield from ((S.NOT_READY.value, one.name) for one in skill.preconditions)
    yield from ((state.value, "") for state in (S.NOT_VALIDATED, S.FAILED, S.INTERRUPTED))


def _brings(system: System, row: Row, effects: EffectsByFault, fault: str, end: End) -> bool:
    """Return whether a fault can bring about this end: by itself, or by a state in which a condition does not hold."""
    known, (state, result) = effects.known[fault], end
    if any(fnmatchcase(f"{row.skill} {result or state}", pattern) for pattern in known.ends):
        return True
    node = system.leaves[row.leaf]
    conditions: Sequence[Precondition | Invariant] = ()
    if state == S.RESOURCE_INVARIANT_VIOLATED.value:
        conditions = node.model.invariants
    elif state == S.NOT_READY.value:
        conditions = node.model.preconditions
    skillset = next(one for one in system.skillsets if one.name == node.skillset)
    return any(_breaks(skillset, one.condition, known.states) for one in conditions if one.name == result)


def _breaks(skillset: Skillset, condition: Expression, states: frozenset[str]) -> bool:
    for resource in skillset.resources:
        for target in resource.states:
            if f"{skillset.name}.{resource.name} {target}" in states:
                transitions = [Transition(source, target, extern=True) for source in resource.states if source != target]
                if any(can_break(skillset, condition, resource, transition) for transition in transitions):
                    return True
    return False
