"""A node of a robot's own that tells how it ticks its children is known as such to all that knows nodes; one that tells nothing is not."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("z3")

from test_prove_mission_live import ONCE, QUIET, written
from test_prove_mission_runs import robots

from alula.check.mission import check_mission
from alula.language.models import ModelFile, check_texts
from alula.missions.mission_file import MissionFile
from alula.missions.part import MissionPart
from alula.prove.limits import Deadline
from alula.prove.mission.regions import Regions
from alula.prove.mission.system import System
from alula.trees import (
    FAILURE,
    RUNNING,
    STRING,
    SUCCESS,
    Answer,
    Condition,
    Control,
    Decorator,
    Node,
    Order,
    TickError,
    Ticking,
    input_port,
    register,
    script_port,
)
from alula.trees.factory import make_tree
from alula.trees.node import NodeConfig
from alula.trees.nodes.decorators import Inverter
from alula.trees.reading import read_text
from alula.trees.standard import standard_registry
from alula.trees.ticking import ANY_TICKING
from alula.trees.view import view_of
from finding_pages.mission_checks import whole
from finding_pages.mission_proofs import ROBOT

MODELS = check_texts([ModelFile("robot.rl", ROBOT)])[0].skillsets


@register("robot.Either")
class Either(Control):
    """Ticks its children one after the other until one succeeds."""

    ticking = Ticking(Order.IN_TURN, FAILURE, place="_turn")
    ends = frozenset({SUCCESS, FAILURE})
    may_run = False

    def __init__(self, config: NodeConfig) -> None:
        super().__init__(config)
        self._turn = 0

    def update(self) -> Answer:
        """Go on with the one that runs."""
        self.become(RUNNING)
        while self._turn < len(self.children):
            answer = self.children[self._turn].execute()
            if answer is RUNNING:
                return RUNNING
            if answer is SUCCESS:
                return self._over(SUCCESS)
            self._turn += 1
        return self._over(FAILURE)

    def halt(self) -> None:
        """Begin with the first child the next time."""
        self._turn = 0
        super().halt()

    def _over(self, answer: Answer) -> Answer:
        self.reset_children()
        self._turn = 0
        return answer


@register("robot.Either")
class Silent(Either):
    """Does the same, and tells nothing of it."""

    ticking = ANY_TICKING


@register("robot.Either")
class Restless(Either):
    """Derives from one that tells it, and does otherwise."""

    def update(self) -> Answer:
        """Begin with the first child in each tick."""
        self._turn = 0
        return super().update()


def checked(inside: str, node: type[Node]) -> list[tuple[str, str]]:
    found = check_mission(MissionFile.read(Path("mission.xml"), MODELS, MissionPart((node,)), text=whole(inside)))
    return [(one.code, one.message) for one in found]


def memories(folder: Path, tag: str, *nodes: type[Node]) -> int:
    asks = f'<{tag}><ScriptCondition code="a == \'DONE\' &amp;&amp; false"/><Sleep msec="100"/></{tag}>'
    system = System.of(MissionFile.read(written(folder, f"{ONCE}{asks}"), robots(), MissionPart(nodes)), QUIET)
    regions = Regions(system, Deadline.after(1e6))
    regions.explore()
    return len(system.ticker.memories)


def test_the_registry_and_the_drawing_know_it() -> None:
    text = '<root BTCPP_format="4"><BehaviorTree ID="m"><robot.Either><AlwaysFailure/><AlwaysSuccess/></robot.Either></BehaviorTree></root>'
    for node, figure in ((Either, "selector"), (Silent, "control"), (Restless, "control")):
        registry = standard_registry()
        assert registry.register(node).described is (None if node is Restless else node)
        assert view_of(make_tree(read_text(text), registry, int).root).kind == figure


def test_check_knows_which_children_it_does_not_tick_and_what_it_does_about_a_failure() -> None:
    unreached = "<robot.Either><AlwaysSuccess/><drone.lift/></robot.Either>"
    assert {code for code, _ in checked(unreached, Either)} == {"ALU610"}
    assert not checked(unreached, Silent)
    assert not checked(unreached, Restless)
    both = "<robot.Either><drone.hover/><drone.hover name='again'/></robot.Either>"
    assert [message for code, message in checked(both, Either) if code == "ALU609"] == [
        "no branch deals with `ABORTED` of 'again': the mission fails"
    ]
    assert not checked(both, Silent)


def test_check_knows_in_which_order_entries_are_written() -> None:
    late = '<robot.Either><ScriptCondition code="n == 1"/><Script code="n := 1"/></robot.Either>'
    assert "ALU607" in {code for code, _ in checked(late, Either)}
    assert "ALU607" not in {code for code, _ in checked(late, Silent)}


def test_the_search_forgets_what_only_passed_children_ask_for(tmp_path: Path) -> None:
    of_ours = memories(tmp_path, "Fallback")
    assert memories(tmp_path, "robot.Either", Either) == of_ours
    assert memories(tmp_path, "robot.Either", Silent) > of_ours
    assert memories(tmp_path, "robot.Either", Restless) > of_ours


def test_a_class_that_halts_otherwise_than_its_base_is_not_taken_for_it() -> None:
    class Kept(Inverter):
        def halt(self) -> None:
            """Leave the child running."""

    class Plain(Inverter):
        pass

    assert Plain.known_ticking() is Inverter.ticking
    assert Kept.known_ticking() is ANY_TICKING
    assert Decorator.known_ticking() is ANY_TICKING


@register("robot.Asked")
class Asked(Condition):
    """Answers by its script."""

    ports = (script_port("that"),)
    answers_by = "that"
    ends = frozenset({SUCCESS, FAILURE})

    def setup(self) -> None:
        """Read it."""
        self._that = self.script("that")

    def update(self) -> Answer:
        """Ask."""
        return SUCCESS if self._that.holds() else FAILURE


@register("robot.Asked")
class Undeclared(Asked):
    """Has a script in a port that does not say so."""

    ports = (input_port("that", STRING),)


def test_what_a_script_of_a_port_reads_is_known() -> None:
    assert [code for code, _ in checked('<robot.Asked that="n == 1"/>', Asked)] == ["ALU607"]
    assert [code for code, _ in checked('<robot.Asked that="n =="/>', Asked)] == ["ALU614"]


def test_a_script_of_a_port_that_does_not_say_so_is_refused() -> None:
    text = '<root BTCPP_format="4"><BehaviorTree ID="m"><robot.Asked that="1"/></BehaviorTree></root>'
    registry = standard_registry()
    registry.register(Undeclared)
    with pytest.raises(TickError, match=r"the port 'that' holds a script, and does not say so: declare it with script_port\('that'\)"):
        make_tree(read_text(text), registry, int)
