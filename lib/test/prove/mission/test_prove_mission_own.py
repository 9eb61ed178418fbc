"""Nodes of a robot's own with children in the search: whatever the class does with them, the search does, too."""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping
from pathlib import Path

import pytest

pytest.importorskip("z3")

import own_nodes
from own_nodes import Moody
from test_prove_mission_runs import PART as PICKS
from test_prove_mission_runs import flown, robots

from alula import trees
from alula.language.errors import Diagnostic, Severity
from alula.language.models import ModelFile, check_texts
from alula.missions.mission_file import MissionFile
from alula.missions.part import NO_PART, MissionPart
from alula.prove.limits import Deadline, OutOfTimeError
from alula.prove.mission.managers import Failures
from alula.prove.mission.oracle import UndecidedError
from alula.prove.mission.play import play
from alula.prove.mission.prover import prove_mission
from alula.prove.mission.regions import Regions
from alula.prove.mission.run import MissionFinding
from alula.prove.mission.runnable import remembered, why_not
from alula.prove.mission.system import System
from alula.trees import DOUBLE, FAILURE, RUNNING, SUCCESS, Answer, Control, Decorator, Node, TickError, input_port, register
from finding_pages.mission_checks import whole

ROVER = """
skillset r1 {
  resource wheels { state { FREE USED } initial FREE transition { FREE -> USED USED -> FREE } }
  skill drive {
    precondition free: wheels == FREE
    start wheels -> USED
    interrupt { effect wheels -> FREE }
    success DONE { effect wheels -> FREE }
  }
}
"""
(R1,) = check_texts([ModelFile("robot.rl", ROVER)])[0].skillsets
PART = MissionPart((*own_nodes.PART.nodes, *PICKS.nodes))
STILL = 'name="own" _description="property still: never r1.wheels == USED"'


def found(folder: Path, text: str, part: MissionPart = PART) -> list[Diagnostic]:
    path = folder / "mission.xml"
    path.write_text(whole(text))
    return prove_mission(MissionFile.read(path, (R1,), part)).findings


def codes(several: list[Diagnostic]) -> set[str]:
    return {one.code for one in several}


@pytest.mark.parametrize("kind", [*own_nodes.RUN, *own_nodes.ANYHOW])
def test_a_property_is_held_against_what_is_below_a_node_of_the_robots_own(kind: str, tmp_path: Path) -> None:
    more = "<AlwaysSuccess/>" if kind == "robot.Recovery" else ""
    ports = 'many="3"' if kind == "robot.Counted" else ""
    several = found(tmp_path, f"<{kind} {ports} {STILL}><r1.drive/>{more}</{kind}>")
    against = next(one for one in several if one.code == "ALU714")
    assert isinstance(against, MissionFinding)
    assert against.run is not None
    assert "ALU711" not in codes(several)
    assert not any(one.code == "ALU703" and "r1.drive" in one.message for one in several)
    assert not play(MissionFile.read(tmp_path / "mission.xml", against.run.skillsets, PART), against.run).left


@register("robot.Never")
class Never(Decorator):
    """Does not tick its child."""

    def update(self) -> Answer:
        """Succeed."""
        return SUCCESS


def test_a_class_that_is_run_is_known_exactly(tmp_path: Path) -> None:
    several = found(tmp_path, f"<robot.Never {STILL}><r1.drive/></robot.Never>", MissionPart((Never,)))
    assert codes(several) == {"ALU703", "ALU715"}


@register("robot.Third")
class ThirdBySeen(Decorator):
    """Ticks its child from the third tick on, by a count in an attribute that one of Alula's nodes has for something else."""

    def setup(self) -> None:
        """Begin to count."""
        self._seen = 0

    def update(self) -> Answer:
        """Count."""
        self.become(RUNNING)
        self._seen += 1 if self._seen < 3 else 0
        return self.child.execute() if self._seen == 3 else RUNNING


@register("robot.Third")
class ThirdByCount(Decorator):
    """As that one, by another attribute."""

    def setup(self) -> None:
        """Begin to count."""
        self._count = 0

    def update(self) -> Answer:
        """Count."""
        self.become(RUNNING)
        self._count += 1 if self._count < 3 else 0
        return self.child.execute() if self._count == 3 else RUNNING


@pytest.mark.parametrize("node", [ThirdBySeen, ThirdByCount])
def test_what_a_class_remembers_means_what_its_code_makes_of_it_whatever_its_name(node: type[Node], tmp_path: Path) -> None:
    several = found(tmp_path, f"<robot.Third {STILL}><r1.drive/></robot.Third>", MissionPart((node,)))
    assert "ALU714" in codes(several)
    assert "ALU703" not in codes(several)


def test_it_is_said_once_for_each_type_how_it_is_taken(tmp_path: Path) -> None:
    inside = "<robot.Guard><r1.drive/></robot.Guard><robot.Guard><robot.Moody><r1.drive/></robot.Moody></robot.Guard>"
    told = {one.message: one for one in found(tmp_path, f"<Fallback>{inside}</Fallback>") if one.code == "ALU715"}
    assert {one.severity for one in told.values()} == {Severity.NOTE}
    guard, moody = sorted(told)
    assert guard == "'robot.Guard' is ticked by its class, and its children with it"
    assert moody.startswith("'robot.Moody' may tick and halt its children in any order, and answer and write anything: ")
    assert "`chance` of the class" in moody


def test_a_class_that_needs_what_the_search_does_not_know_does_anything_instead(tmp_path: Path) -> None:
    """The number that it asks for is written by a leaf that may write anything."""
    inside = '<robot.Pick number="{many}"/><robot.Counted many="{many}"><r1.drive/></robot.Counted>'
    several = found(tmp_path, f"<Sequence {STILL}>{inside}</Sequence>")
    told = next(one.message for one in several if one.code == "ALU715")
    assert "mission.xml:" in told
    assert "the port 'many' is not known" in told
    assert "ALU714" in codes(several)


@pytest.mark.parametrize(("kind", "exact"), [("robot.Guard", True), ("robot.Moody", False)])
def test_what_must_come_is_said_to_hang_on_a_node_that_may_keep_it_from_coming(kind: str, exact: bool, tmp_path: Path) -> None:  # noqa: FBT001
    wanted = '_description="property over: eventually outcome accomplished or outcome given_up assuming termination"'
    several = found(tmp_path, f"<{kind} {wanted}><r1.drive/></{kind}>")
    told = [one for one in several if one.code == "ALU715" and one.severity is Severity.WARNING]
    assert "ALU714" not in codes(several)
    assert ["`over`" in one.message and "'robot.Moody' keeps it" in one.message for one in told] == ([] if exact else [True])


DECLARED = """<root BTCPP_format="4" main_tree_to_execute="mission">
  <BehaviorTree ID="mission">
    <Sequence name="own" _description="property still: never r1.wheels == USED">
      <Look where="{found}"/>
      <ScriptCondition name="at the door" code="found == 'door'"/>
      <Often times="3"><r1.drive/></Often>
    </Sequence>
  </BehaviorTree>
  <TreeNodesModel>
    <Action ID="Look"><output_port name="where" type="std::string"/></Action>
    <Decorator ID="Often"><input_port name="times"/></Decorator>
  </TreeNodesModel>
</root>"""


def test_a_node_that_is_only_declared_may_answer_and_write_anything(tmp_path: Path) -> None:
    several = found(tmp_path, DECLARED, NO_PART)
    assert codes(several) >= {"ALU714", "ALU715"}
    assert codes(several).isdisjoint({"ALU703", "ALU706", "ALU711"})
    told = [one.message for one in several if one.code == "ALU715"]
    assert len(told) == 2
    assert all("the file declares it, and no class is known" in one for one in told)


SEEING = """
type Spot
skillset eyes {
  skill look {
    output { spot: Spot }
    success SEEN
  }
  skill wave { success DONE }
}
"""
PLACED = """<Sequence>
  <eyes.look spot="{spot}"/>
  <robot.Place seen="{PORT}" far="{far}"/>
  <ScriptCondition name="it is far" code="far &gt;= 3"/>
  <eyes.wave/>
</Sequence>"""


def known_to(folder: Path, text: str, inputs: Mapping[str, object]) -> System:
    """Return a mission as odds look at it, with inputs that are known."""
    (eyes,) = check_texts([ModelFile("robot.rl", SEEING)])[0].skillsets
    names = "".join(f'<input_port name="{name}"/>' for name in inputs)
    path = folder / "mission.xml"
    path.write_text(whole(text).replace("</root>", f'<TreeNodesModel><SubTree ID="mission">{names}</SubTree></TreeNodesModel></root>'))
    part = MissionPart((own_nodes.Place,))
    return System.of(MissionFile.read(path, (eyes,), part), Failures(refusals=False, hooks=False, aborts=False), known=inputs)


def answers(system: System) -> dict[str, set[str]]:
    """Return what nodes answer in all runs, by their names."""
    regions = Regions(system, Deadline.after(1e6))
    regions.explore()
    touched = {one for region in regions.regions for _, ticked in region.next for way, _ in ticked.ways for one in way.touched}
    found: dict[str, set[str]] = {}
    for number, status in touched:
        found.setdefault(system.nodes[number].name, set()).add(status)
    return found


def test_a_leaf_that_computes_with_what_nobody_knows_may_answer_and_write_anything(tmp_path: Path) -> None:
    both = {"SUCCESS", "FAILURE"}
    told = answers(known_to(tmp_path, PLACED.replace("PORT", "spot"), {}))
    assert (told["robot.Place"], told["it is far"]) == (both, both)
    told = answers(known_to(tmp_path, PLACED.replace("PORT", "place"), {"place": {"x": 2.5}}))
    assert (told["robot.Place"], told["it is far"]) == ({"SUCCESS"}, {"SUCCESS"})


def test_a_leaf_whose_code_breaks_on_what_is_known_is_named(tmp_path: Path) -> None:
    system = known_to(tmp_path, PLACED.replace("PORT", "place"), {"place": 3})
    with pytest.raises(UndecidedError, match=r"mission\.xml:\d+:\d+ \(robot\.Place\): its code raises TypeError: 'int'"):
        answers(system)


# --- which classes are run ---------------------------------------------------------------------------------------------


@register("robot.Spelled")
class Spelled(trees.Decorator):
    """Names what is public by its module."""

    def update(self) -> Answer:
        """Tick the child once."""
        return trees.SUCCESS if self.child.execute() is not trees.RUNNING else trees.RUNNING


@pytest.mark.parametrize("kind", [*own_nodes.RUN.values(), Spelled])
def test_code_that_hangs_on_nothing_else_is_run(kind: type[Node]) -> None:
    assert why_not(kind) == ""


@register("robot.Doubled")
class Doubled(Decorator):
    """Sets up what it counts, and gives up where its port is too small: all by what is public."""

    ports = (input_port("least", DOUBLE, "1"),)

    def setup(self) -> None:
        """Begin to count."""
        self.count = 0

    def update(self) -> Answer:
        """Tick the child in each second tick."""
        self.count = 1 - self.count
        if self.real("least") < 1.0:
            raise TickError("too small")
        return self.child.execute() if self.count else RUNNING


def test_code_over_the_public_names_is_run_and_remembers_what_it_has_set_up() -> None:
    assert (why_not(Doubled), remembered(Doubled)) == ("", ("count",))


TABLE = {"SUCCESS": SUCCESS}


class Looks(Decorator):
    """Looks into a table that may change."""

    def update(self) -> Answer:
        """Look."""
        return TABLE["SUCCESS"]


class Catches(Decorator):
    """Catches what breaks below it."""

    def update(self) -> Answer:
        """Tick the child."""
        try:
            return self.child.execute()
        except ValueError:
            return FAILURE


class Reads(Decorator):
    """Reads the blackboard behind its ports."""

    def update(self) -> Answer:
        """Read."""
        return SUCCESS if self.blackboard.get("x") else self.child.execute()


class Late(Decorator):
    """Sets an attribute that it has not from the begin."""

    def update(self) -> Answer:
        """Set it."""
        self.late = True
        return SUCCESS


class Reaches(Control):
    """Ticks what is none of its children."""

    def update(self) -> Answer:
        """Tick it."""
        return self.children[0].children[0].execute()


class Shared(Decorator):
    """Has a list that all of its kind share."""

    seen: list[str] = []  # noqa: RUF012 - that is what is tested

    def update(self) -> Answer:
        """Fill it."""
        self.seen.append(self.name)
        return RUNNING


class Opens(Decorator):
    """Reads a file."""

    def update(self) -> Answer:
        """Read it."""
        return SUCCESS if open("x").read() else FAILURE  # noqa: PTH123 - never run


class Local(Decorator):
    """Calls a function that does more than compute."""

    def update(self) -> Answer:
        """Call it."""
        return by_table("SUCCESS")


def by_table(name: str) -> Answer:
    """Return what stands in a table."""
    return TABLE[name]


@pytest.mark.parametrize("kind", [Looks, Catches, Reads, Late, Reaches, Shared, Opens, Local, Moody])
def test_code_that_may_hang_on_more_is_not_run(kind: type[Node]) -> None:
    assert why_not(kind)


# --- held against flights ------------------------------------------------------------------------------------------------

LEAVES = (
    "<drone.lift/>",
    "<drone.hover/>",
    "<drone.climb/>",
    '<ScriptCondition code="drone.control == OURS"/>',
    '<Sleep msec="250"/>',
    '<Script code="tries += 1"/>',
    '<ScriptCondition code="many &gt;= tries"/>',
    '<drone.hover outcome="{who}"/>',
    "<robot.Shy/>",
)
WITH_ONE = ("robot.Guard", "robot.Limit", 'robot.Counted many="{many}"', "robot.Seldom", 'robot.Counted many="2"')
WITH_TWO = ("robot.Recovery", "robot.ByTurns", "robot.Careless", 'robot.Moody number="{many}"')
ABOVE = ("Sequence", "Fallback", 'Parallel success_count="1" failure_count="1"', "ReactiveSequence", "SequenceWithMemory")
ROUND = ("ForceSuccess", "Inverter", 'RetryAfter attempts="4" wait="0.2" if="tries &lt; 3"', 'Timeout msec="300"')
MOST = 4000
"""Ticks of a mission; one with more is not looked at."""


def tree(chance: random.Random, depth: int, own: tuple[tuple[str, ...], tuple[str, ...]]) -> str:
    """Return a random tree whose nodes are the robot's own, each second one."""
    if depth == 0:
        return chance.choice(LEAVES)
    one, two = own if chance.random() < 0.6 else (ROUND, ABOVE)
    if chance.random() < 0.4:
        tag = chance.choice(one)
        return f"<{tag}>{tree(chance, depth - 1, own)}</{tag.split()[0]}>"
    tag = chance.choice(two)
    return f"<{tag}>{tree(chance, depth - 1, own)}{tree(chance, depth - 1, own)}</{tag.split()[0]}>"


class Few(Deadline):
    """A bound of ticks in the place of one of time."""

    left = MOST

    def check(self) -> None:
        """Raise OutOfTimeError after so many."""
        self.left -= 1
        if self.left <= 0:
            raise OutOfTimeError("enough")


def searched(path: Path) -> Regions | None:
    """Return all runs of a mission, None where they are too many."""
    failures = Failures(hooks=False, refusals=False, aborts=False)
    for why in ("", "it needs what is not known"):
        regions = Regions(System.of(MissionFile.read(path, robots(), PART), failures, why_any_order=why), Few.after(1e6))
        try:
            regions.explore()
        except OutOfTimeError:
            return None
        except UndecidedError:
            continue
        return regions
    return None


def within(regions: Regions) -> Callable[[frozenset[int], Mapping[str, str], str], bool]:
    """Return what tells whether a situation that was flown is one of the search."""
    system = regions.system
    known: dict[tuple[frozenset[int], str], list[list[set[tuple[str, ...]]]]] = {}
    for region in regions.regions:
        end = system.ticker.memories[region.memory].end
        active = frozenset(node.uid for node in system.active(region)) if end is None else frozenset()  # type: ignore[arg-type]
        states = [{tuple(system.managers_of(one).states or ()) for one in numbers} for numbers in region.sets]
        known.setdefault((active, end.value if end else ""), []).append(states)

    def is_known(active: frozenset[int], resources: Mapping[str, str], end: str) -> bool:
        if end:
            return any(one == end for _, one in known)
        seen = [tuple(resources[f"{one.name}.{resource.name}"] for resource in one.resources) for one in system.skillsets]
        return any(all(one in states for one, states in zip(seen, several, strict=True)) for several in known.get((active, end), ()))

    return is_known


KINDS = {
    "run": (WITH_ONE[:2], WITH_TWO[:3]),
    "anyhow": (WITH_ONE[2:], WITH_TWO[3:]),
    "all": (WITH_ONE, WITH_TWO),
}


@pytest.mark.parametrize("seed", range(16))
@pytest.mark.parametrize("kind", KINDS)
def test_what_the_engine_does_with_own_nodes_is_within_the_search(kind: str, seed: int, tmp_path: Path) -> None:
    chance = random.Random(f"{kind} {seed}")  # noqa: S311 - for tests
    path = tmp_path / "mission.xml"
    first = """<Script code="tries := 0"/><robot.Pick number="{many}" text="{who}" thing="{thing}"/>"""
    path.write_text(whole(f"<Sequence>{first}{tree(chance, 2, KINDS[kind])}<drone.land/></Sequence>"))
    regions = searched(path)
    if regions is None:
        pytest.skip("too many situations")
    is_known = within(regions)
    Moody.chance = chance
    for _ in range(12):
        for number, (active, resources, end) in enumerate(flown(path, chance, PART)):
            assert is_known(active, resources, end), (number, sorted(active), resources, end)
