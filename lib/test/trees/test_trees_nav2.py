"""Nav2's own nodes do what Nav2's documentation says of them."""

from __future__ import annotations

import pytest

pytest.importorskip("py_trees")

from alula.trees import nav2
from alula.trees.answers import WORDS, Answers, StepClock, scripted_tree, ticks
from alula.trees.errors import TreeError
from alula.trees.nav2.decorators import DistanceController, PathLongerOnApproach, SpeedController
from alula.trees.palette import Palette
from alula.trees.reading import read_text
from alula.trees.standard import standard_palette

SHORT = {"R": "RUNNING", "S": "SUCCESS", "F": "FAILURE", "K": "SKIPPED"}


class Rig:
    """A tree; ``script``: the answers of a leaf as letters."""

    def __init__(self, body: str, palette: Palette | None = None, **script: str) -> None:
        self.answers = Answers({name: [WORDS[SHORT[letter]] for letter in letters] for name, letters in script.items()})
        self.clock = StepClock()
        files = read_text(f'<root BTCPP_format="4"><BehaviorTree ID="Main">{body}</BehaviorTree></root>')
        self.tree = scripted_tree(files, standard_palette() | (palette or nav2.palette()), self.answers, self.clock)

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


def test_a_pause_that_nobody_asks_for_changes_nothing():
    assert told("<PauseResumeController><a/><b/></PauseResumeController>", 2, a="RS", b="S") == ["R sa", "S ta"]


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


def test_the_goal_is_handed_on():
    rig = Rig('<GoalUpdater input_goal="{goal}" output_goal="{new}"><a/></GoalUpdater>', a="S")
    rig.tree.blackboard.set("goal", (1.0, 2.0))
    assert rig.tick() == ["S sa"]
    assert rig.tree.blackboard.get("new") == (1.0, 2.0)


def own(node: type) -> Palette:
    """Return Nav2's nodes with one of one's own in the place of its base."""
    palette = Palette([one for one in nav2.palette() if one.name != node.__base__.__name__])
    palette.register(node, node.__base__.__name__)
    return palette


def test_a_distance_opens_when_the_robot_has_gone_so_far():
    place = [0.0, 0.0, 0.0]

    class Here(DistanceController):
        def where(self):
            return tuple(place)

    body = '<PipelineSequence><DistanceController distance="2.0"><a/></DistanceController><b/></PipelineSequence>'
    rig = Rig(body, own(Here), a="S", b="R")
    found = []
    for place[0] in (0.0, 1.9, 2.0, 3.9, 4.1):
        found += rig.tick()
    assert found == ["R sa sb", "R tb", "R sa tb", "R tb", "R sa tb"]
    assert Rig(body, a="S", b="R").tick(3) == ["R sa sb", "R tb", "R tb"]


def test_a_speed_sets_the_rate():
    speed = [1.0]

    class Moving(SpeedController):
        def speed(self):
            return speed[0]

    body = '<PipelineSequence><SpeedController min_rate="1.0" max_rate="5.0"><a/></SpeedController><b/></PipelineSequence>'
    rig = Rig(body, own(Moving), a="S", b="R")
    begun = [index for index, line in enumerate(rig.tick(5)) if "sa" in line]
    assert begun == [0, 2, 4]  # each 0.2 s
    speed[0] = 0.0
    begun = [index for index, line in enumerate(rig.tick(22), start=5) if "sa" in line]
    assert begun == [6, 16, 26]  # after the period that had begun, each second
    with pytest.raises(TreeError, match="can't have a rate of 0"):
        Rig('<SpeedController min_rate="0.0"><a/></SpeedController>', a="S").tick()


def test_a_path_that_grows_near_the_goal_is_told():
    body = '<PathLongerOnApproach path="{path}" prox_len="3.0" length_factor="2.0"><a/></PathLongerOnApproach>'
    rig = Rig(body, a="RS")
    assert rig.tick() == ["S"]  # without a path
    near, far, detour = [(0.0, 0.0), (2.0, 0.0)], [(0.0, 0.0), (9.0, 0.0)], [(0.0, 0.0), (2.0, 5.0), (2.0, 0.0)]
    for path, answer in ((near, "S"), (detour, "R sa"), (detour, "S ta"), (far, "S"), (near, "S"), (near, "S")):
        rig.tree.blackboard.set("path", path)
        assert rig.tick() == [answer]
    assert issubclass(PathLongerOnApproach, object)


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
