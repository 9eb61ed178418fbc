"""Mocks: what a behaviour says is what happens, at the moment it says, and the same seed makes the same story."""

from __future__ import annotations

from textwrap import dedent

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from alula.common.faults import FaultRequest
from alula.mock import Behaviour, BehaviourError, Ending, Formula, FormulaError, MockChange, Rule, load_behaviour, mock_world
from alula.model.execution_state import ExecutionState
from alula.model.model import Data, Parameter, Result, ResultKind
from alula.runtime.core.errors import SkillRuntimeError
from alula.runtime.core.events import event_record
from alula_testing.runtime_models import flying_skill, flying_skillset

S = ExecutionState
FLYING = flying_skillset(data=(Data("battery", "float64", period_s=1.0), Data("pose", "Pose")))


class Mocked:
    """A mocked skillset that is ready to fly, and its client."""

    def __init__(self, behaviour: Behaviour | None = None, *, skillset=FLYING, seed: int = 0, authority: bool = True) -> None:
        self.world, self.robot = mock_world([skillset], behaviour, seed=seed)
        self.client = self.world.client(skillset.name)
        assert self.client.wait_ready(0.0)
        if authority:
            assert self.client.transition("sdk", "AVAILABLE").get(0.0).accepted

    def call(self, height: float = 3.0, limit_s: float = 100.0):
        """Call the skill; return how it ended and after how many seconds."""
        begun_s = self.world.now_s
        handle = self.client.start("takeoff", height=height)
        handle.wait(limit_s)
        return (handle.outcome, handle.result or handle.message), round(self.world.now_s - begun_s, 6)


@pytest.fixture
def read(tmp_path):
    def read(*texts: str, skillset=FLYING) -> Behaviour:
        paths = [tmp_path / f"{number}.yaml" for number in range(len(texts))]
        for path, text in zip(paths, texts, strict=True):
            path.write_text(dedent(text))
        return load_behaviour(paths, [skillset])

    return read


def test_without_a_script_a_skill_ends_with_its_first_good_result_after_a_second():
    mocked = Mocked()
    handle = mocked.client.start("takeoff", height=3.0)
    mocked.world.run_for(0.51)
    assert handle.progress == pytest.approx(0.5)
    assert handle.wait(10.0)
    assert (handle.outcome, handle.result, mocked.world.now_s) == ("TERMINATED", "DONE", 1.0)


@pytest.mark.parametrize(
    ("results", "wanted"),
    [
        ((Result("UNLOCKED"), Result("ARRIVED")), "UNLOCKED"),
        ((Result("ARRIVED"), Result("well", ResultKind.SUCCESS)), "well"),
        ((Result("bad", ResultKind.FAILURE), Result("LOST")), ""),
        ((), ""),
    ],
)
def test_what_is_a_good_result(results, wanted):
    skill = flying_skill("takeoff", results=results, preconditions=(), invariants=())
    mocked = Mocked(skillset=flying_skillset(skill))
    handle = mocked.client.start("takeoff", height=3.0)
    mocked.world.run_for(50.0)
    assert handle.result == wanted
    assert handle.state is (S.TERMINATED if wanted else S.RUNNING)
    assert wanted or handle.progress == 1.0


def test_an_endless_mock_can_be_interrupted():
    mocked = Mocked(Behaviour(rules={("flying", "takeoff"): (Rule(ending=Ending()),)}))
    handle = mocked.client.start("takeoff", height=3.0)
    mocked.world.run_for(1000.0)
    handle.interrupt()
    assert handle.wait(0.0)
    assert handle.outcome == "INTERRUPTED"


def test_rules_by_call_by_inputs_and_for_the_rest(read):
    behaviour = read(
        """
        skills:
          flying.takeoff:
            - {call: 2, result: BLOCKED, message: a gust}
            - {when: height > 100, refuse: too high}
            - {call: 5, crash: a wire broke, delay: 0.25}
            - {call: 6, crash: at once, delay: 0}
            - {delay: height / 2, result: DONE}
        """
    )
    mocked = Mocked(behaviour)
    assert mocked.call(3.0) == (("TERMINATED", "DONE"), 1.5)
    assert mocked.call(4.0) == (("TERMINATED", "BLOCKED"), 2.0)
    assert mocked.call(101.0) == (("NOT_VALIDATED", "too high"), 0.0)
    assert mocked.call(1.0) == (("TERMINATED", "DONE"), 0.5)
    assert mocked.call(1.0) == (("FAILED", "the mock crashed: a wire broke"), 0.25)
    assert mocked.call(1.0) == (("FAILED", "on_dispatch raised MockCrashError: at once"), 0.0)
    assert mocked.client.resources["axes"] == "AVAILABLE"


def test_a_later_file_comes_before_an_earlier_one_and_leaves_the_rest_to_it(read):
    below = "memory: {speed: 2}\nskills: {flying.takeoff: {delay: height / speed, result: DONE}}\n"
    above = "memory: {speed: 4}\nskills: {flying.takeoff: {call: 1, result: BLOCKED}}\n"
    mocked = Mocked(read(below, above))
    assert mocked.call(8.0) == (("TERMINATED", "BLOCKED"), 2.0)
    assert mocked.call(8.0) == (("TERMINATED", "DONE"), 2.0)


def test_chance_and_weights_and_distributions_follow_the_seed(read):
    behaviour = read(
        """
        skills:
          flying.takeoff:
            - {chance: 0.3, refuse: no luck}
            - {delay: "uniform(1, 2)", result: {DONE: 3, BLOCKED: 1}}
        """
    )

    def story(seed: int):
        mocked = Mocked(behaviour, seed=seed)
        return [mocked.call() for _ in range(200)]

    first = story(1)
    assert first == story(1)
    assert first != story(2)
    refused = sum(outcome == "NOT_VALIDATED" for (outcome, _), _ in first)
    done = sum(result == "DONE" for (_, result), _ in first)
    assert 35 <= refused <= 85  # 60 expected; 4 standard deviations
    assert 0.6 <= done / (200 - refused) <= 0.9
    delays = [delay for (outcome, _), delay in first if outcome == "TERMINATED"]
    assert all(1.0 <= delay <= 2.0 for delay in delays)
    assert len(set(delays)) == len(delays)


def test_progress_follows_its_curve_or_its_formula(read):
    curve = read("skills: {flying.takeoff: {delay: 10, progress: [[0, 0], [0.5, 0.2], [0.5, 0.6], [1, 1]]}}")
    formula = read("skills: {flying.takeoff: {delay: 10, progress: f * f}}")
    for behaviour, expected in ((curve, [0.08, 0.2 * 0.98, 0.68, 0.96]), (formula, [0.04, 0.2401, 0.36, 0.9025])):
        mocked = Mocked(behaviour)
        handle = mocked.client.start("takeoff", height=3.0)
        for moment_s, progress in zip((2.0, 4.9, 6.0, 9.5), expected, strict=True):
            mocked.world.run_for(moment_s - mocked.world.now_s)
            mocked.world.run_for(0.0)
            assert handle.progress == pytest.approx(progress, abs=1e-9)


def test_outputs_are_formulas_or_texts_as_the_model_says(read):
    skill = flying_skill("takeoff", outputs=(Parameter("reached", "float64"), Parameter("words", "string")))
    skillset = flying_skillset(skill)
    behaviour = read("skills: {flying.takeoff: {outputs: {reached: height * 0.9, words: height * 0.9}}}", skillset=skillset)
    mocked = Mocked(behaviour, skillset=skillset)
    handle = mocked.client.start("takeoff", height=10.0)
    assert handle.wait(5.0)
    assert handle.outputs == {"reached": 9.0, "words": "height * 0.9"}


def test_transitions_of_a_skill_come_at_their_moment_unless_it_is_stopped_before(read):
    behaviour = read("skills: {flying.takeoff: {delay: 5, result: DONE, then: [{after: delay - 1, set: {flying.sdk: UNAVAILABLE}}]}}")
    mocked = Mocked(behaviour)
    assert mocked.call() == (("RESOURCE_INVARIANT_VIOLATED", "keep_sdk"), 4.0)
    mocked = Mocked(behaviour)
    handle = mocked.client.start("takeoff", height=3.0)
    mocked.world.run_for(3.9)
    handle.interrupt()
    mocked.world.run_for(10.0)
    assert mocked.client.resources["sdk"] == "AVAILABLE"


def test_a_mock_that_is_stopped_half_way_leaves_the_memory_half_way(read):
    behaviour = read("memory: {at: [0, 0], level: 1}\nskills: {flying.takeoff: {delay: 10, moves: {at: '[height, 10]', level: 3}}}")
    mocked = Mocked(behaviour)
    handle = mocked.client.start("takeoff", height=4.0)
    mocked.world.run_for(5.0)
    assert mocked.robot.value(Formula("at[0] + level"), {}) == 4.0
    handle.interrupt()
    mocked.world.run_for(5.0)
    assert mocked.robot.memory == {"at": [2.0, 5.0], "level": 2.0}
    assert mocked.call(4.0) == (("TERMINATED", "DONE"), 10.0)
    assert mocked.robot.memory == {"at": [4.0, 10.0], "level": 3}


def test_the_timeline_counts_from_the_start_or_from_the_first_time_of_a_state(read):
    behaviour = read(
        """
        timeline:
          - {after: 2, set: {flying.sdk: AVAILABLE}}
          - {after: 3, since: flying.axes USED, set: {flying.sdk: UNAVAILABLE}}
        skills: {flying.takeoff: {never: true}}
        """
    )
    mocked = Mocked(behaviour, authority=False)
    mocked.world.run_for(1.99)
    assert mocked.client.resources["sdk"] == "UNAVAILABLE"
    mocked.world.run_for(3.01)
    assert mocked.call() == (("RESOURCE_INVARIANT_VIOLATED", "keep_sdk"), 3.0)
    assert mocked.robot.host.notes == []


def test_what_a_model_has_no_transition_for_is_told(read):
    behaviour = read("timeline: [{after: 1, set: {flying.sdk: AVAILABLE}}, {after: 2, set: {flying.sdk: AVAILABLE}}]")
    mocked = Mocked(behaviour, authority=False)
    mocked.world.run_for(5.0)
    assert mocked.robot.host.notes == []  # the state that it has already needs no transition
    mocked.world.kill("flying")
    mocked.robot.take({("flying", "sdk"): "UNAVAILABLE"})
    assert mocked.robot.host.notes == ["the mock can't have flying.sdk be UNAVAILABLE: the managers of flying are not there"]


def test_faults_wait_for_their_anchor_and_are_noticed_late(read):
    text = "faults: {pilot: {since: flying.axes USED, delay: 0.5, set: {flying.sdk: UNAVAILABLE}}, early: {set: {flying.sdk: UNAVAILABLE}}}"
    behaviour = read(text + "\nskills: {flying.takeoff: {never: true}}")
    mocked = Mocked(behaviour)
    mocked.robot.fail(FaultRequest("pilot", begin_s=3.0))
    mocked.world.run_for(10.0)
    assert mocked.client.resources["sdk"] == "AVAILABLE"
    assert mocked.call() == (("RESOURCE_INVARIANT_VIOLATED", "keep_sdk"), 3.5)
    assert mocked.robot.faults == {"pilot": 13.0}
    mocked = Mocked(behaviour)
    mocked.robot.fail(FaultRequest("early", begin_s=2.0))
    assert mocked.call() == (("RESOURCE_INVARIANT_VIOLATED", "keep_sdk"), 2.0)
    with pytest.raises(SkillRuntimeError, match="no fault 'zed' in the behaviour; it has pilot, early"):
        mocked.robot.fail(FaultRequest("zed", begin_s=1.0))
    with pytest.raises(SkillRuntimeError, match=r"no fault 'pilt' in the behaviour; it has pilot, early \(did you mean `pilot`\?\)"):
        mocked.robot.fail(FaultRequest("pilt", begin_s=1.0))


def test_a_fault_may_end_what_runs_of_a_skill(read):
    mocked = Mocked(read("skills: {flying.takeoff: {never: true}}", "faults: {rotor: {delay: 1, ends: {flying.takeoff: BLOCKED}}}"))
    mocked.robot.fail(FaultRequest("rotor", begin_s=3.0))
    assert mocked.call() == (("TERMINATED", "BLOCKED"), 4.0)
    assert mocked.call(limit_s=10.0)[0][0] == "", "only what runs at that moment"
    assert mocked.robot.host.notes == []


def test_a_fault_with_an_end_gives_back_what_it_took(read):
    text = "faults: {pilot: {delay: 0.5, set: {flying.sdk: UNAVAILABLE}}, 'pilot:twice': {set: {flying.sdk: UNAVAILABLE}}}"
    mocked = Mocked(read(text))
    mocked.robot.fail(FaultRequest("pilot", "rudely", 2.0, 5.0))
    mocked.world.run_for(2.6)
    assert mocked.client.resources["sdk"] == "UNAVAILABLE"
    mocked.robot.take({("flying", "sdk"): "AVAILABLE"})
    assert mocked.client.resources["sdk"] == "UNAVAILABLE", "a fault holds what it has taken"
    mocked.world.run_for(2.7)
    assert mocked.client.resources["sdk"] == "UNAVAILABLE", "its end is noticed late, too"
    mocked.world.run_for(0.3)
    assert mocked.client.resources["sdk"] == "AVAILABLE"
    assert mocked.robot.faults == {"pilot": 2.0}
    assert mocked.robot.host.notes == []
    behaviour = read(text)
    assert behaviour.fault(FaultRequest("pilot", "twice"))[0] == "pilot:twice"
    assert behaviour.fault(FaultRequest("pilot", "once"))[0] == "pilot"


def test_data_follow_their_steps_and_their_formulas(read):
    behaviour = read(
        """
        memory: {x: 7}
        data:
          flying.battery: {values: {0: 1.0, 3: 1 - t / 10, 6: null}}
          flying.pose: {period: 2, value: {place: {x: x, y: 0.5}, marks: [1, x]}}
        """
    )
    mocked = Mocked(behaviour)
    seen: list = []
    first = mocked.client.read_data("battery").get(1.0)
    assert (first.value, first.stamp_ns) == (1.0, 0)
    mocked.client.data_feed("battery").on_sample(lambda sample: seen.append((mocked.world.now_s, sample.value)))
    mocked.world.run_for(20.0)
    assert [(moment, round(value, 9)) for moment, value in seen] == [(0, 1.0), (1, 1.0), (2, 1.0), (3, 0.7), (4, 0.6), (5, 0.5)]
    assert mocked.client.read_data("battery").get(1.0).stale
    pose = mocked.client.read_data("pose").get(1.0).value
    assert pose == {"place": {"x": 7, "y": 0.5}, "marks": [1, 7]}


def test_a_formula_without_a_value_ends_the_execution_and_says_so(read):
    mocked = Mocked(read("skills: {flying.takeoff: {delay: 1 / height}}"))
    (outcome, message), _ = mocked.call(0.0)
    assert outcome == "FAILED"
    assert "`1 / height` has no value: ZeroDivisionError" in message
    mocked = Mocked(read("skills: {flying.takeoff: {outputs: {reached: 1 / height}}}"))
    assert mocked.call(0.0)[0][0] == "FAILED"


def test_a_test_writes_its_behaviour_in_python():
    drops = MockChange(lambda names: names["delay"] / 2, {("flying", "sdk"): "UNAVAILABLE"})
    rules = (Rule(call=1, delay=lambda names: names["height"] * 2, changes=(drops,)), Rule(ending=Ending(refuse="enough")))
    mocked = Mocked(Behaviour(rules={("flying", "takeoff"): rules[:1]}))
    assert mocked.call(4.0) == (("RESOURCE_INVARIANT_VIOLATED", "keep_sdk"), 4.0)
    mocked = Mocked(Behaviour(rules={("flying", "takeoff"): rules}))
    assert mocked.call(4.0) == (("NOT_VALIDATED", "enough"), 0.0)


WRONG = {
    "skills: {flying.takeof: {}}": "1: skillset flying has no skill takeof; it has takeoff (did you mean `takeoff`?)",
    "skills: {flyin.takeoff: {}}": "1: the robot has no skillset flyin; it has flying (did you mean `flying`?)",
    "skills: {takeoff: {}}": "1: `takeoff` should name skillset and skill, as `navigation.takeoff`",
    "skills:\n  flying.takeoff:\n    delai: 1": "3: a rule of flying.takeoff has no `delai`; it may have call, when",
    "skills: {flying.takeoff: {result: WON}}": "1: flying.takeoff has no result WON; it has DONE, BLOCKED, SAFE",
    "skills: {flying.takeoff: {result: {DONE: 0}}}": "1: the weights of the results are all 0",
    "skills: {flying.takeoff: {result: {DONE: -1}}}": "1: the weight of DONE should be a number from 0 on, not -1",
    "skills: {flying.takeoff: {result: DONE, never: true}}": "1: flying.takeoff can't have both `result` and `never` in one rule",
    "skills: {flying.takeoff: {message: hi}}": "1: `message` goes with a `result`",
    "skills: {flying.takeoff: {refuse: ''}}": "1: `refuse` is the reason of the refusal or crash; it should not be empty",
    "skills: {flying.takeoff: {never: 3}}": "1: write `never: true`, or leave it out",
    "skills: {flying.takeoff: {call: 0}}": "1: `call` should be a number from 1 on, not 0",
    "skills: {flying.takeoff: {call: 1.5}}": "1: `call` counts calls from 1, 1.5 is none",
    "skills: {flying.takeoff: {chance: 2}}": "1: `chance` should be a number from 0 to 1, not 2",
    "skills: {flying.takeoff: {delay: -1}}": "1: a time is a number of seconds from 0 on",
    "skills: {flying.takeoff: {delay: heigth}}": "1: `heigth`: heigth is not known; there are height (did you mean `height`?)",
    "skills: {flying.takeoff: {delay: '1 +'}}": "1: `1 +`: expected a value, found the end of the formula (character 4)",
    "skills: {flying.takeoff: {delay: 'open(height)'}}": "1: `open(height)`: there is no function open; there are distance",
    "skills: {flying.takeoff: {delay: 'height.__class__'}}": "1: `height.__class__`: the field __class__ is not allowed in formulas",
    "skills: {flying.takeoff: {delay: '[x for x in height]'}}": "expected `,` or `]`, found `for`",
    "skills: {flying.takeoff: {progress: [[0, 0], [0, 2]]}}": "1: a point of the progress should be a number from 0 to 1, not 2",
    "skills: {flying.takeoff: {progress: [[1, 0], [0, 1]]}}": "1: `progress` is a formula, or points",
    "skills: {flying.takeoff: {outputs: {height: 1}}}": "1: flying.takeoff has no output height; it has reached",
    "skills: {flying.takeoff: {moves: {at: 1}}}": "1: the mock has no memory at; it has none",
    "skills: {flying.takeoff: {then: [{set: {flying.sdk: AVAILABLE}}]}}": "1: `after` is missing",
    "skills: {flying.takeoff: 3}": "1: a rule of flying.takeoff should be a mapping (`name: value`), not `3`",
    "skills: 3": "1: skills should be a mapping",
    "timeline: [{after: 1, set: {flying.sdk: BUSY}}]": "1: resource flying.sdk has no state BUSY; it has UNAVAILABLE, AVAILABLE",
    "timeline: [{after: 1, set: {flying.axes: USED}}]": "1: flying.axes has no extern transition to USED; there are some to none",
    "timeline: [{after: 1, since: flying.sdk, set: {flying.sdk: AVAILABLE}}]": "write a resource and a state, as",
    "faults: {zed: {set: {flying.wings: BROKEN}}}": "1: skillset flying has no resource wings; it has sdk, axes",
    "faults: {zed: {ends: {flying.takeoff: BROKEN}}}": "1: flying.takeoff has no result BROKEN; it has DONE, BLOCKED, SAFE",
    "faults: {zed: {delay: 1}}": "1: `set` is missing",
    "data: {flying.fuel: {value: 1}}": "1: skillset flying has no data fuel; it has battery, pose",
    "data: {flying.battery: {}}": "1: flying.battery needs either `value` or `values`",
    "data: {flying.battery: {values: {soon: 1}}}": "`soon` should be seconds since the start",
    "memory: {a: 1}\nmemory: {b: 1}": "2: a behaviour file: `memory` is given twice",
    "nonsense: 1": "1: a behaviour file has no `nonsense`; it may have memory, skills, timeline, faults, data",
    "skills: [": "is no YAML",
    "memory: {a: !!python/object/apply:os.getcwd []}": "could not determine a constructor",
    "&a [*a]": "1: a behaviour file should be a mapping",
}


@pytest.mark.parametrize("text", WRONG)
def test_a_wrong_file_is_refused_with_place_and_remedy(tmp_path, text):
    path = tmp_path / "mock.yaml"
    path.write_text(text)
    with pytest.raises(BehaviourError) as error:
        load_behaviour([path], [FLYING])
    assert str(error.value).startswith(f"{path}:")
    assert WRONG[text] in str(error.value)
    assert "\n" not in str(error.value)


def test_a_file_that_can_not_be_read_is_named(tmp_path):
    with pytest.raises(BehaviourError, match=r"nowhere.yaml: can't be read: No such file"):
        load_behaviour([tmp_path / "nowhere.yaml"], [FLYING])
    (tmp_path / "binary.yaml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(BehaviourError, match=r"binary.yaml: is no YAML text"):
        load_behaviour([tmp_path / "binary.yaml"], [FLYING])
    (tmp_path / "empty.yaml").write_text("# nothing\n")
    assert load_behaviour([tmp_path / "empty.yaml"], [FLYING]) == Behaviour()


@settings(max_examples=150)
@given(st.text(max_size=40))
def test_any_text_is_a_formula_or_refused(text):
    try:
        formula = Formula(text)
    except FormulaError as error:
        assert "\n" not in str(error).replace(text, "")  # noqa: PT017
    else:
        assert isinstance(formula.names, frozenset)


ENDINGS = [
    Ending((("DONE", 1.0), ("BLOCKED", 1.0))),
    Ending((("SAFE", 1.0),)),
    Ending(),
    Ending(refuse="no"),
    Ending(crash="bang"),
]
RULES = st.builds(
    Rule,
    call=st.none() | st.integers(1, 4),
    chance=st.none() | st.sampled_from([0.0, 0.5, 1.0]),
    delay=st.none() | st.sampled_from([0.0, 0.5, 2.0, Formula("uniform(0, 3)")]),
    ending=st.none()
    | st.sampled_from(
        [Ending((("DONE", 1.0), ("BLOCKED", 1.0))), Ending(), Ending(refuse="no"), Ending(crash="bang"), Ending((("SAFE", 1.0),))]
    ),
    changes=st.none() | st.just((MockChange(Formula("delay / 2"), {("flying", "sdk"): "UNAVAILABLE"}),)),
)


@settings(max_examples=60)
@given(st.lists(RULES, max_size=3), st.lists(st.floats(0.0, 2.0), max_size=5), st.integers(0, 5))
def test_whatever_the_script_every_execution_ends_once_and_the_story_repeats(rules, gaps, seed):
    def story():
        mocked = Mocked(Behaviour(rules={("flying", "takeoff"): tuple(rules)}), seed=seed)
        told = []
        mocked.client.on_event(lambda event: told.append(event_record(event)))
        handles = []
        for gap_s in gaps:
            handles.append(mocked.client.start("takeoff", height=3.0))
            mocked.world.run_for(gap_s)
        for handle in handles:
            handle.interrupt()
        mocked.world.run_for(5.0)
        assert all(handle.done for handle in handles)
        assert mocked.world.errors == [error for error in mocked.world.errors if "MockCrashError: bang" in error]
        return told

    first = story()
    ends = [record["id"] for record in first if record["kind"] == "EXECUTION" and S(record["state"]).terminal]
    assert len(ends) == len(set(ends)) == len(gaps)
    assert story() == first
