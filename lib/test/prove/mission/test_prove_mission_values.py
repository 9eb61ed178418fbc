"""Values that the search does not know: whatever a node of the standard makes of one, the search looks at."""

from __future__ import annotations

import random
from collections.abc import Sequence
from pathlib import Path
from typing import ClassVar

import pytest

pytest.importorskip("z3")

from test_prove_mission_own import R1, Few, within
from test_prove_mission_runs import flown, robots

from alula.language.errors import Diagnostic
from alula.missions.mission_file import MissionFile
from alula.missions.part import NO_PART, MissionPart
from alula.prove.limits import OutOfTimeError
from alula.prove.mission.managers import Failures
from alula.prove.mission.oracle import Oracle, UndecidedError
from alula.prove.mission.play import play
from alula.prove.mission.prover import prove_mission
from alula.prove.mission.regions import Regions
from alula.prove.mission.run import MissionFinding
from alula.prove.mission.system import System
from alula.prove.mission.unknown import UnknownNumber
from alula.trees.node import SyncAction, register
from alula.trees.ports import output_port
from alula.trees.status import SUCCESS, Answer
from alula.trees.values import ANY, BOOL, INT, STRING
from finding_pages.mission_checks import whole

STILL = 'name="own" _description="property still: never r1.wheels == USED"'


@register("robot.Tell")
class Tell(SyncAction):
    """Writes values of each kind, by chance."""

    ports = (output_port("number", INT), output_port("flag", BOOL), output_port("text", STRING), output_port("thing", ANY))
    chance: ClassVar[random.Random] = random.Random(0)  # noqa: S311 - for tests
    texts: ClassVar[Sequence[str]] = ("anna", "ben", "2", "2.0", "1;2", "anna;ben", "")

    def update(self) -> Answer:
        """Write anything."""
        chance = self.chance
        self.put("number", chance.randrange(-1, 4))
        self.put("flag", chance.random() < 0.5)
        self.put("text", chance.choice(self.texts))
        self.put("thing", chance.choice(({"name": "a thing"}, ["anna", "ben"], "anna", "2;3", 2)))
        return SUCCESS


PART = MissionPart((Tell,))
MODELS = """<TreeNodesModel>
  <SubTree ID="mission">INPUTS</SubTree>
  <Action ID="Look"><output_port name="what"/></Action>
  <Action ID="Read"><output_port name="what" type="std::string"/></Action>
  <Action ID="Count"><output_port name="what" type="int"/></Action>
</TreeNodesModel></root>"""
WRITTEN = {
    "text of the robot's own node": '<robot.Tell text="{x}"/>',
    "number of the robot's own node": '<robot.Tell number="{x}"/>',
    "anything of the robot's own node": '<robot.Tell thing="{x}"/>',
    "what a declared node writes": '<Look what="{x}"/>',
    "text of a declared node": '<Read what="{x}"/>',
    "number of a declared node": '<Count what="{x}"/>',
    "input of the mission": "",
}


def mission(folder: Path, text: str, inputs: str = "") -> Path:
    path = folder / "mission.xml"
    path.write_text(whole(text).replace("</root>", MODELS.replace("INPUTS", inputs)))
    return path


def against(path: Path) -> MissionFinding:
    """Return the finding against the property; all runs of the mission were looked at."""
    proved = prove_mission(MissionFile.read(path, (R1,), PART))
    several: list[Diagnostic] = proved.findings
    assert proved.complete
    assert "ALU711" not in {one.code for one in several}, [one.message for one in several]
    return next(one for one in several if isinstance(one, MissionFinding) and one.code == "ALU714")


def inside(how: str, reader: str) -> tuple[str, str]:
    """Return what writes and reads ``x``, and the mission's inputs; a number is copied, so that it may be read as of another type."""
    if how.startswith("number"):
        reader = f'<Script code="copy := x"/>{reader.replace("{x}", "{copy}")}'
    return f"<Sequence {STILL}>{WRITTEN[how]}{reader}</Sequence>", '<input_port name="x"/>' if "input" in how else ""


TEXTS = 'case_1="anna" case_2="2"'
DRIVES_AT_TWO = f'<Switch2 variable="{{x}}" {TEXTS}><AlwaysSuccess/><r1.drive/><AlwaysSuccess/></Switch2>'
DRIVES_ELSE = f'<Switch2 variable="{{x}}" {TEXTS}><AlwaysSuccess/><AlwaysSuccess/><r1.drive/></Switch2>'


@pytest.mark.parametrize("how", WRITTEN)
@pytest.mark.parametrize("reader", [DRIVES_AT_TWO, DRIVES_ELSE])
def test_each_case_of_a_switch_is_looked_at(how: str, reader: str, tmp_path: Path) -> None:
    path = mission(tmp_path, *inside(how, reader))
    found = against(path)
    assert found.run is not None
    assert not play(MissionFile.read(path, found.run.skillsets, PART), found.run).left


COUNTED = (
    '<Repeat num_cycles="{x}"><r1.drive/></Repeat>',
    '<RetryUntilSuccessful num_attempts="{x}"><r1.drive/></RetryUntilSuccessful>',
    '<RetryAfter attempts="{x}" wait="0.2" if="true"><r1.drive/></RetryAfter>',
    '<Sequence><Sleep msec="{x}"/><r1.drive/></Sequence>',
    '<Delay delay_msec="{x}"><r1.drive/></Delay>',
    '<Timeout msec="{x}"><r1.drive/></Timeout>',
    '<Sequence><Repeat num_cycles="{x}"><AlwaysSuccess/></Repeat><r1.drive/></Sequence>',
    '<RunOnce then_skip="{y}"><Sequence><Sleep msec="{x}"/><r1.drive/></Sequence></RunOnce>',
)
NUMBERS = [how for how in WRITTEN if "text" not in how and "anything" not in how]


@pytest.mark.parametrize("how", NUMBERS)
@pytest.mark.parametrize("reader", COUNTED)
def test_counts_and_times_may_be_any(how: str, reader: str, tmp_path: Path) -> None:
    path = mission(tmp_path, *inside(how, f'<Script code="y := true"/>{reader}'))
    found = against(path)
    assert found.run is not None
    assert not play(MissionFile.read(path, found.run.skillsets, PART), found.run).left


LOOPS = (
    """<LoopString queue="{x}" value="{v}"><Sequence><ScriptCondition code="v == 'anna'"/><r1.drive/></Sequence></LoopString>""",
    '<Fallback><LoopString queue="{x}" value="" if_empty="FAILURE"><AlwaysSuccess/></LoopString><r1.drive/></Fallback>',
)


@pytest.mark.parametrize("how", [how for how in WRITTEN if "number" not in how])
@pytest.mark.parametrize("reader", LOOPS)
def test_a_loop_is_looked_at_with_any_items(how: str, reader: str, tmp_path: Path) -> None:
    path = mission(tmp_path, *inside(how, reader))
    found = against(path)
    assert found.run is not None
    assert not play(MissionFile.read(path, found.run.skillsets, PART), found.run).left


def test_what_a_switch_has_seen_of_a_text_stays_so(tmp_path: Path) -> None:
    """In one run, a text is not first this case and then that one."""
    both = """
      <Switch2 variable="{x}" case_1="anna" case_2="ben">
        <ReactiveSequence>
          <Switch2 variable="{x}" case_1="anna" case_2="ben"><AlwaysSuccess/><r1.drive/><r1.drive/></Switch2>
        </ReactiveSequence>
        <AlwaysSuccess/>
        <AlwaysSuccess/>
      </Switch2>"""
    path = mission(tmp_path, f'<Sequence {STILL}><robot.Tell text="{{x}}"/><Sleep msec="20"/>{both}</Sequence>')
    assert "ALU714" not in {one.code for one in prove_mission(MissionFile.read(path, (R1,), PART)).findings}


def test_a_number_of_which_no_type_is_known_is_told_with_its_cure(tmp_path: Path) -> None:
    path = mission(tmp_path, '<Sequence><robot.Tell thing="{x}"/><Repeat num_cycles="{x}"><r1.drive/></Repeat></Sequence>')
    (finding,) = prove_mission(MissionFile.read(path, (R1,), PART)).findings
    assert finding.code == "ALU711"
    assert "`x` as int, and what has written it does not say of which type it is" in finding.message


def test_a_text_that_is_made_of_a_number_is_told_rather_than_taken_for_another(tmp_path: Path) -> None:
    script = "<ScriptCondition code=\"('at ' .. x) == 'at 2'\"/>"
    path = mission(tmp_path, f'<Sequence><robot.Tell number="{{x}}"/>{script}<r1.drive/></Sequence>')
    assert [one.code for one in prove_mission(MissionFile.read(path, (R1,), PART)).findings] == ["ALU711"]


def test_scripts_compare_what_a_declared_node_writes_by_what_they_need(tmp_path: Path) -> None:
    for script in ("x == 'door'", "x &gt; 3", "!x", "x + 1 == 3"):
        path = mission(tmp_path, f'<Sequence {STILL}><Look what="{{x}}"/><ScriptCondition code="{script}"/><r1.drive/></Sequence>')
        assert against(path).run is not None


OF_ITS_OWN = """<BehaviorTree ID="opens">
  <Sequence><Look what="{x}"/><ScriptCondition code="x == 'door'"/><r1.drive/></Sequence>
</BehaviorTree>
<BehaviorTree ID="counts"><Sequence><Look what="{x}"/><ScriptCondition code="x &gt; 3"/></Sequence></BehaviorTree>
<BehaviorTree ID="apart"><Sequence><Look what="{x}"/><ScriptCondition code="!x"/></Sequence></BehaviorTree>
<TreeNodesModel>"""


def test_what_a_subtree_needs_of_an_entry_of_its_own_says_nothing_of_anothers_and_a_tree_that_is_not_used_nothing(tmp_path: Path) -> None:
    path = mission(tmp_path, f'<Sequence {STILL}><ForceSuccess><SubTree ID="counts"/></ForceSuccess><SubTree ID="opens"/></Sequence>')
    text = path.read_text().replace("<TreeNodesModel>", OF_ITS_OWN)
    path.write_text(text.replace("<root ", '<root main_tree_to_execute="mission" '))
    assert against(path).run is not None


# --- held against flights ------------------------------------------------------------------------------------------------

CASES = ('case_1="anna" case_2="2"', 'case_1="ben" case_2="{seen}"', 'case_1="1" case_2="3"', 'case_1="0" case_2="{who}"')
READERS = (
    *(
        f'<Switch2 variable="{{{name}}}" {cases}><child/><child/><child/></Switch2>'
        for name in ("seen", "who", "thing", "on")
        for cases in CASES
    ),
    '<Repeat num_cycles="{many}"><child/></Repeat>',
    '<RetryUntilSuccessful num_attempts="{many}"><child/></RetryUntilSuccessful>',
    '<RetryAfter attempts="{many}" wait="0.2" if="tries &lt; 3"><child/></RetryAfter>',
    '<Sequence><Script code="pause := many * 100"/><Timeout msec="{pause}"><child/></Timeout></Sequence>',
    '<Delay delay_msec="{ms}"><child/></Delay>',
    '<Parallel success_count="{many}" failure_count="2"><child/><child/></Parallel>',
    '<RunOnce then_skip="{sure}"><child/></RunOnce>',
    '<LoopString queue="{who}" value="{one}"><Fallback><ScriptCondition code="one == \'ben\'"/><child/></Fallback></LoopString>',
    '<LoopString queue="{thing}" value="{one}" if_empty="FAILURE"><child/></LoopString>',
    '<LoopInt queue="{who}" value="{item}"><Sequence><ScriptCondition code="item == 2"/><child/></Sequence></LoopInt>',
    '<SubTree ID="visit" host="{who}" count="{seen}"/>',
)
LEAVES = (
    "<drone.lift/>",
    "<drone.hover/>",
    "<drone.climb/>",
    '<Sleep msec="{ms}"/>',
    '<Script code="seen := many; ms := many; on := sure"/>',
    '<robot.Tell number="{many}" text="{who}" thing="{thing}" flag="{sure}"/>',
    "<ScriptCondition code=\"who == 'anna' || who == '2'\"/>",
    '<ScriptCondition code="many &gt;= tries"/>',
    '<ScriptCondition code="sure &amp;&amp; many != 2"/>',
    '<Script code="tries += 1"/>',
    '<ScriptCondition code="many / 0 &gt; 3"/>',
    '<SetBlackboard value="{who}" output_key="last"/>',
    '<Switch2 variable="{last}" case_1="anna" case_2="ben"><drone.lift/><drone.hover/><AlwaysFailure/></Switch2>',
)
VISIT = """<BehaviorTree ID="visit">
  <Switch2 variable="{host}" case_1="ben" case_2="{count}"><drone.lift/><drone.hover/><AlwaysFailure/></Switch2>
</BehaviorTree></root>"""


def reading(chance: random.Random, depth: int) -> str:
    """Return a random tree whose nodes decide by what another one has written."""
    if depth == 0:
        return chance.choice(LEAVES)
    above = [f"<{one}><child/><child/></{one}>" for one in ("Sequence", "Fallback", "ReactiveSequence")]
    parts = chance.choice((*READERS, *above)).split("<child/>")
    return "".join(f"{part}{reading(chance, depth - 1)}" for part in parts[:-1]) + parts[-1]


DECLARED = """<TreeNodesModel><Action ID="robot.Tell">
  <output_port name="number" type="int"/><output_port name="flag" type="bool"/>
  <output_port name="text" type="std::string"/><output_port name="thing"/>
</Action></TreeNodesModel></root>"""


def searched(path: Path, part: MissionPart) -> Regions:
    """Return all runs of a mission; skips where they are too many, or hang on what the search does not know."""
    regions = Regions(
        System.of(MissionFile.read(path, robots(), part), Failures(hooks=False, refusals=False, aborts=False)), Few.after(1e6)
    )
    try:
        regions.explore()
    except OutOfTimeError:
        pytest.skip("too many situations")
    except UndecidedError as error:
        pytest.skip(str(error))
    return regions


@pytest.mark.parametrize("seed", range(60))
def test_what_the_engine_does_with_written_values_is_within_the_search(seed: int, tmp_path: Path) -> None:
    """Nodes whose class is known, and every third time ones that are only declared."""
    chance = random.Random(f"values {seed}")  # noqa: S311 - for tests
    path = tmp_path / "mission.xml"
    told = '<robot.Tell number="{many}" text="{who}" thing="{thing}" flag="{sure}"/>'
    first = f"""<Script code="tries := 0; last := ''"/>{told}<Script code="seen := many; ms := many; on := sure"/>"""
    tree = whole(f"<Sequence>{first}{reading(chance, 1 + seed % 2)}<drone.land/></Sequence>").replace("</root>", VISIT)
    text = tree.replace("<root ", '<root main_tree_to_execute="mission" ')
    declared = seed % 3 == 0
    path.write_text(text.replace("</root>", DECLARED) if declared else text)
    regions = searched(path, NO_PART if declared else PART)
    is_known = within(regions)
    Tell.chance = chance
    for _ in range(12):
        for number, (active, resources, end) in enumerate(flown(path, chance, PART)):
            assert is_known(active, resources, end), (number, sorted(active), resources, end)


def test_answers_about_a_whole_number_agree() -> None:
    oracle = Oracle()
    oracle.begin(lambda _: None, (True,))
    number = UnknownNumber(oracle, "`x`", -5.0, 5.0, whole=True)
    assert number > 2
    assert [number > 2, number >= 1, number <= 2, number == 2] == [True, True, False, False]
    assert len(oracle.asked) == 1
