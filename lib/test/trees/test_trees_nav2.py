"""Nav2's own nodes: what is ticked does what Nav2's documentation says, all others are declarations."""

from __future__ import annotations

import pytest

pytest.importorskip("py_trees")

from alula.api.checking import check_files, checked_files, prove_files
from alula.check.findings import findings_of
from alula.cli.options.models import NAV2_RELEASES
from alula.cli.palette import main
from alula.common.robots import meaning
from alula.trees import nav2
from alula.trees.answers import WORDS, Answers, StepClock, scripted_tree, ticks
from alula.trees.errors import TreeError
from alula.trees.nav2.plugin import TICKED, TOLD
from alula.trees.node_type import Category
from alula.trees.reading import read_text
from alula.trees.standard import standard_registry

SHORT = {"R": "RUNNING", "S": "SUCCESS", "F": "FAILURE", "K": "SKIPPED"}


class Rig:
    """A tree; ``script``: the answers of a leaf as letters."""

    def __init__(self, body: str, stand_ins: dict[str, str] | None = None, **script: str) -> None:
        answers = {name: [WORDS[SHORT[letter]] for letter in letters] for name, letters in script.items()}
        self.answers = Answers(answers, stand_ins=stand_ins or {})
        self.clock = StepClock()
        files = read_text(f'<root BTCPP_format="4"><BehaviorTree ID="Main">{body}</BehaviorTree></root>')
        self.tree = scripted_tree(files, standard_registry() | nav2.registry(), self.answers, self.clock)

    def tick(self, count: int = 1) -> list[str]:
        """Return a line a tick: the root's answer, and what the leaves were asked (s, t, h and the name)."""
        return [
            " ".join([tick.root[0], *(f"{call[0]}{leaf}" for call, leaf in tick.calls)])
            for tick in ticks(self.tree, self.answers, count, self.clock)
        ]


def told(body: str, count: int, **script: str) -> list[str]:
    return Rig(body, **script).tick(count)


def anew(leaf: str) -> str:
    """Return a leaf that begins anew after its end; one that was not reset keeps its answer, as in BehaviorTree.CPP."""
    return f'<Repeat num_cycles="1"><{leaf}/></Repeat>'


PIPELINE = f"<PipelineSequence>{anew('a')}{anew('b')}</PipelineSequence>"


def test_a_pipeline_ticks_what_it_has_passed_again():
    found = told(f"<PipelineSequence>{anew('a')}{anew('b')}<c/></PipelineSequence>", 5, a="RSRSS", b="RSRRS", c="RRRS")
    assert found == ["R sa", "R ta sb", "R sa tb sc", "R ta sb tc", "R sa tb tc"]
    assert told(PIPELINE, 3, a="SRF", b="R") == ["R sa sb", "R sa tb", "F ta hb"]
    assert told(PIPELINE, 1, a="K", b="K") == ["S sa sb"]


def test_a_pipeline_has_its_last_child_decide():
    found = told(PIPELINE, 3, a="SRR", b="RS")
    assert found == ["R sa sb", "S sa tb ha", "R sa"]


def test_a_recovery_is_tried_after_a_failure_so_many_times():
    body = '<RecoveryNode number_of_retries="2"><a/><b/></RecoveryNode>'
    assert told(body, 1, a="S", b="S") == ["S sa"]
    assert told(body, 1, a="FS", b="S") == ["S sa sb sa"]
    assert told(body, 2, a="F", b="S") == ["F sa sb sa sb sa"] * 2
    assert told(body, 1, a="F", b="F") == ["F sa sb"]
    assert told(body, 1, a="F", b="K") == ["F sa sb"]
    assert told(body, 1, a="K", b="S") == ["S sa"]
    assert told(body, 3, a="RFS", b="RS") == ["R sa", "R ta sb", "S tb sa"]
    with pytest.raises(TreeError, match="'RecoveryNode' has 1 child; it takes 2"):
        told("<RecoveryNode><a/></RecoveryNode>", 1, a="S")


def test_round_robin_takes_turns():
    body = '<RoundRobin wrap_around="true"><a/><b/><c/></RoundRobin>'
    # As its documentation's example goes, a tick a row.
    found = told(f"<KeepRunningUntilFailure>{body}</KeepRunningUntilFailure>", 2, a="F", b="S", c="F")
    assert found == ["R sa sb", "R sc sa sb"]
    rig = Rig(f"<Sequence>{body}{body}<d/></Sequence>", a="RFR", b="RS", c="F", d="S")
    assert rig.tick(3) == ["R sa", "R ta sb", "R tb sa"]
    assert told(body, 1, a="F", b="F", c="F") == ["F sa sb sc"]
    assert told(body, 1, a="K", b="K", c="F") == ["F sa sb sc"]
    assert told(body, 1, a="K", b="K", c="K") == ["S sa sb sc"]


def test_round_robin_does_not_begin_again_unless_it_is_told_to():
    rig = Rig("<KeepRunningUntilFailure><RoundRobin><a/><b/></RoundRobin></KeepRunningUntilFailure>", a="SF", b="SF")
    assert rig.tick(1) == ["R sa"]
    assert told("<RoundRobin><a/><b/></RoundRobin>", 1, a="F", b="S") == ["S sa sb"]
    assert told("<RoundRobin><a/><b/></RoundRobin>", 2, a="F", b="F") == ["F sa sb"] * 2


def test_a_nonblocking_sequence_ticks_all():
    body = f"<NonblockingSequence>{anew('a')}{anew('b')}</NonblockingSequence>"
    assert told(body, 3, a="RSS", b="RRS") == ["R sa sb", "R ta tb", "S sa tb"]
    assert told(body, 2, a="RF", b="R") == ["R sa sb", "F ta hb"]
    with pytest.raises(TreeError, match="'b' is skipped, which a NonblockingSequence"):
        told("<NonblockingSequence><a/><b/></NonblockingSequence>", 1, a="S", b="K")


def test_a_persistent_sequence_keeps_its_place_on_the_blackboard():
    body = '<Sequence><Script code="at:=1"/><PersistentSequence current_child_idx="{at}"><a/><b/></PersistentSequence></Sequence>'
    rig = Rig(body, a="S", b="RF")
    assert rig.tick() == ["R sb"]
    assert rig.tree.blackboard.get("at") == 1
    assert rig.tick() == ["F tb"]
    assert rig.tree.blackboard.get("at") == 0
    rig = Rig(body, a="S", b="S")
    assert rig.tick() == ["S sb"]


def test_a_rate_limits_how_often_the_child_is_begun():
    body = '<ReactiveSequence><RateController hz="{}"><a/></RateController><b/></ReactiveSequence>'
    rig = Rig('<PipelineSequence><RateController hz="2.5"><a/></RateController><b/></PipelineSequence>', a="S", b="R")
    # The first time, and when 0.4 s are over; a tick takes 0.1 s.
    assert rig.tick(9) == ["R sa sb", "R tb", "R tb", "R tb", "R sa tb", "R tb", "R tb", "R tb", "R sa tb"]
    assert Rig(body.format("1.0"), a="RRS", b="S").tick(3) == ["R sa", "R ta", "S ta sb"]


def test_a_trigger_lets_its_child_end_once():
    found = told("<PipelineSequence><SingleTrigger><a/></SingleTrigger><b/></PipelineSequence>", 3, a="RS", b="R")
    assert found == ["R sa", "R ta sb", "F hb"]
    found = told("<NonblockingSequence><SingleTrigger><a/></SingleTrigger><b/></NonblockingSequence>", 3, a="S", b="R")
    assert found == ["R sa sb", "F hb", "R sa sb"]


def test_a_goal_that_changes_opens():
    rig = Rig('<PipelineSequence><GoalUpdatedController goal="{g}"><a/></GoalUpdatedController><b/></PipelineSequence>', a="S", b="R")
    assert rig.tick(2) == ["R sa sb", "R tb"]
    rig.tree.blackboard.set("g", (1.0, 2.0))
    assert rig.tick(2) == ["R sa tb", "R tb"]


@pytest.mark.parametrize(
    "body",
    [
        '<RecoveryNode number_of_retries="-1"><a/><a/></RecoveryNode>',
        '<Sequence><Script code="at := -2"/><PersistentSequence current_child_idx="{at}"><a/></PersistentSequence></Sequence>',
    ],
)
def test_a_count_below_zero_is_refused_with_its_place(body):
    with pytest.raises(TreeError, match=r"<text>:1:.*, and has to be 0 or more"):
        told(body, 1, a="S")


def test_no_retries_is_one_try():
    assert told('<RecoveryNode number_of_retries="0"><a/><b/></RecoveryNode>', 1, a="F", b="S") == ["F sa"]


# --- declarations -------------------------------------------------------------------------------------------------------

FILE = '<root BTCPP_format="4" main_tree_to_execute="Main"><BehaviorTree ID="Main">{}</BehaviorTree></root>'


def told_of(body: str) -> list[tuple[str, str, str]]:
    """Return what is found in a tree of others: code, severity, message."""
    found = findings_of("m.xml", FILE.format(body).encode(), (), of_others=True)
    return [(one.code, one.severity.value, one.message) for one in found]


@pytest.mark.parametrize("node", [*TICKED, *TOLD])
def test_a_class_has_the_ports_and_the_category_that_nav2_declares(node):
    known = nav2.registry("lyrical").get(node.__name__)
    assert known.category is node.category
    if node in TICKED:
        mine = {port.name: (port.direction, port.type, port.default) for port in node.ports}
        assert mine == {port.name: (port.direction, port.type, port.default) for port in known.ports.values()}


def test_releases_declare_what_they_have():
    assert nav2.RELEASES == NAV2_RELEASES
    by_release = {release: nav2.registry(release) for release in nav2.RELEASES}
    assert [len(one.names()) for one in by_release.values()] == [53, 65, 70, 81]
    spins = [list(known.get("Spin").ports) for known in by_release.values()]
    assert ["disable_collision_checks" in ports for ports in spins] == [False, False, True, True]
    assert ["error_code_id" in ports for ports in spins] == [False, True, True, True]
    waits = [known.get("Wait").ports["wait_duration"].type.name for known in by_release.values()]
    assert waits == ["int", "double", "double", "double"]
    assert nav2.registry().get("Wait").ports["wait_duration"].type.name == "double"
    assert [known.get("IsStopped") is not None for known in by_release.values()] == [False, False, True, False]


def test_nothing_ticks_what_asks_a_robot():
    kinds: dict[bool, set[str]] = {True: set(), False: set()}
    for one in nav2.registry():
        kinds[one.is_tickable].add(one.name)
    assert kinds[True] == {node.__name__ for node in TICKED}
    body = '<Sequence><DistanceController distance="1"><Spin spin_dist="1"/></DistanceController></Sequence>'
    with pytest.raises(TreeError, match="nothing here ticks a 'DistanceController'; say in the answers what stands in"):
        told(body, 1, Spin="S")
    rig = Rig(body, {"DistanceController": "pass-through"}, Spin="RS")
    assert rig.tick(2) == ["R sSpin", "S tSpin"]


def test_conditions_and_quick_actions_never_run_and_actions_of_servers_may():
    runs = {one.name: one.may_run for one in nav2.registry()}
    assert not any(runs[one.name] for one in nav2.registry() if one.category is Category.CONDITION)
    assert [runs[name] for name in ("Spin", "ClearEntireCostmap", "TruncatePath", "PlannerSelector")] == [True, True, False, False]
    body = "<ReactiveSequence><{}/><{}/></ReactiveSequence>"
    assert told_of(body.format('GoalReached goal="{goal}"', 'TruncatePath input_path="{path}" output_path="{path}"')) == []
    found = told_of(body.format("Spin", "BackUp"))
    assert found == [
        ("ALU611", "warning", "'BackUp' in a ReactiveSequence takes several ticks, as 'Spin' before it: each may have the other halted")
    ]


def test_a_navigator_writes_the_goal_and_what_else_is_read_unchecked_is_told():
    plan = '<ComputePathToPose goal="{goal}" path="{path}" planner_id="{planner}"/>'
    expected = "`planner` is read, nothing before writes it, and 'ComputePathToPose' goes on with an empty one"
    assert told_of(plan) == [("ALU607", "warning", expected)]
    assert told_of(f'<Sequence><PlannerSelector topic_name="p" selected_planner="{{planner}}"/>{plan}</Sequence>') == []


def test_a_node_of_ones_own_by_the_name_of_one_of_nav2s_is_not_taken_for_it():
    assert told_of('<Sequence><Wait msec="3"/><GoalUpdated/></Sequence>') == [("ALU601", "warning", "the node 'Wait' is not declared")]
    ((code, severity, message),) = told_of('<Sequence><Spin spin_dist="1" spin_dis="2"/><GoalUpdated/></Sequence>')
    assert (code, severity) == ("ALU603", "warning")
    assert message == "'Spin' is used otherwise than it is declared; here 'Spin' has no port 'spin_dis'"
    alike = told_of("<Sequence><NavigateToPoses/><GoalUpdated/></Sequence>")
    assert alike == [("ALU601", "warning", "the node 'NavigateToPoses' is not declared")]
    model = '<TreeNodesModel><Action ID="Spin"><input_port name="turns"/></Action></TreeNodesModel>'
    assert told_of(f'<GoalUpdated/></BehaviorTree>{model}<BehaviorTree ID="X"><Spin turns="2"/>') == []


def test_a_declaration_that_has_less_gives_way_to_what_nav2_declares():
    model = '<TreeNodesModel><Action ID="Spin"><input_port name="spin_dist"/></Action></TreeNodesModel>'
    assert told_of(f'<Spin spin_dist="1" is_recovery="true"/></BehaviorTree>{model}<BehaviorTree ID="X"><GoalUpdated/>') == []


def test_a_mission_of_ones_own_needs_a_class_for_them():
    text = FILE.format('<Sequence><Spin spin_dist="1"/><DistanceController><Wait/></DistanceController></Sequence>')
    (finding,) = findings_of("m.xml", text.encode(), ())
    assert finding.code == "ALU620"
    assert finding.message == "'Spin' and 2 more are declared by Nav2, and no class makes them"
    assert finding.hint == "write a class for Spin, DistanceController, Wait in the robot's part `missions`"


def test_the_runs_of_a_tree_of_nav2s_are_looked_at(tmp_path):
    tree = tmp_path / "tree.xml"
    tree.write_text(
        FILE.format('<ReactiveSequence><GoalUpdated/><DistanceController><Spin spin_dist="1"/></DistanceController></ReactiveSequence>')
    )
    with meaning(None):
        files = checked_files([str(tree)])
        prove_files(files, 20.0)
    told = [(one.code, one.message) for file in files for one in file.findings]
    anything = "answer and write anything: Nav2 declares it, and no class is known"
    assert told == [
        ("ALU715", f"'GoalUpdated' may {anything}"),
        ("ALU715", f"'DistanceController' may tick and halt its children in any order, and {anything}"),
        ("ALU715", f"'Spin' may {anything}"),
    ]


def test_a_palette_of_a_release_refuses_what_it_has_not(tmp_path, capsys):
    assert main(["--nav2", "humble"]) == 0
    humble = tmp_path / "humble.model"
    humble.write_text(capsys.readouterr().out)
    text = FILE.format('<Spin spin_dist="1" disable_collision_checks="true"/>').encode()
    (finding,) = findings_of("m.xml", text, (), [humble], of_others=True)
    assert (finding.code, finding.message) == ("ALU603", "'Spin' has no port 'disable_collision_checks'")
    assert findings_of("m.xml", text, (), of_others=True) == []
    quick = '<TruncatePath input_path="{path}" output_path="{path}"/>'
    known = FILE.format(f'<ReactiveSequence>{quick}<Wait wait_duration="2"/></ReactiveSequence>').encode()
    assert findings_of("m.xml", known, (), [humble], of_others=True) == []  # it does not run, which a palette can't tell
    for words in ([], ["--nav2", "humble", "trees"], ["--nav2", "humble", "--guess"]):
        assert main(words) == 2
        assert "takes a FOLDER of a robot's models or of trees, or --nav2 RELEASE by itself" in capsys.readouterr().err


def test_a_node_of_nav2_that_a_palette_declares_is_proved_as_one_without_a_class(tmp_path, monkeypatch):
    (tmp_path / "palette.xml").write_text(
        '<root BTCPP_format="4"><TreeNodesModel><Action ID="Spin"><input_port name="spin_dist"/></Action></TreeNodesModel></root>'
    )
    (tmp_path / "m.xml").write_text('<root BTCPP_format="4"><BehaviorTree ID="a"><Spin spin_dist="1.57"/></BehaviorTree></root>')
    monkeypatch.chdir(tmp_path)
    found = check_files("m.xml", palettes=["palette.xml"])
    assert [(one.code, one.message.split(":")[0]) for one in found] == [("ALU715", "'Spin' may answer and write anything")]
