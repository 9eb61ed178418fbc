"""The counterexamples of the proofs, played in the managers: each comes to the end that it tells."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

from alula.cli import check
from alula.language.counterexamples import Counterexample, CounterexampleEnd, CounterexampleStep, NumberedExecution, StateChange
from alula.language.counterexamples import StepKind as Kind
from alula.prove.skillset.play import play
from alula_testing.counterexamples import DATA, EXAMPLES, OUTSIDE, counterexamples


def differences(skillset, counterexample):
    return [(number, one.differences) for number, one in enumerate(play(skillset, counterexample), 1) if one.differences]


@pytest.mark.parametrize("code", sorted(EXAMPLES))
def test_every_counterexample_of_the_page_plays(code, tmp_path):
    skillset, findings = counterexamples(tmp_path / "example.rl", EXAMPLES[code])
    for finding in findings:
        assert differences(skillset, finding.counterexample) == [], finding.counterexample_lines


@pytest.mark.parametrize("text", [DATA, OUTSIDE], ids=["data and time", "from outside"])
def test_counterexamples_with_data_time_and_transitions_from_outside_play(text, tmp_path):
    skillset, findings = counterexamples(tmp_path / "example.rl", text)
    assert findings
    for finding in findings:
        assert differences(skillset, finding.counterexample) == [], finding.counterexample_lines
    told = {step.kind.value for finding in findings for step in finding.counterexample.steps}
    assert {"data", "time", "start"} <= told if text is DATA else "outside" in told


def test_a_counterexample_that_is_not_so_is_told(tmp_path):
    skillset, findings = counterexamples(tmp_path / "example.rl", EXAMPLES["ALU513"])
    (finding,) = findings
    last = finding.counterexample.steps[-1]
    wrong = replace(last, states=(("gear", "Up"),), changes=(StateChange("gear", "Moving", "Up"),))
    found = differences(skillset, Counterexample((*finding.counterexample.steps[:-1], wrong)))
    assert found == [(len(finding.counterexample.steps), ("gear is Down in the managers, Up in the counterexample",))]


def test_an_execution_that_ends_otherwise_or_not_at_all_is_told(tmp_path):
    skillset, findings = counterexamples(tmp_path / "example.rl", DATA)
    steps = next(finding.counterexample.steps for finding in findings if finding.counterexample.steps[-1].ended)
    (end,) = steps[-1].ended
    for ended, told in (((replace(end, state="FAILED", name=""),), "FAILED"), ((), "running")):
        found = differences(skillset, Counterexample((*steps[:-1], replace(steps[-1], ended=ended))))
        called = f"{end.execution.skill} (execution {end.execution.number})"
        assert found == [(len(steps), (f"{called} is {end.state} {end.name} in the managers, {told} in the counterexample",))]


LOOK = NumberedExecution("look", 1)
SEES = CounterexampleStep(
    Kind.DATA, "data come", data=((("fps",), 30.0), (("battery", "level"), 0.9), (("battery", "cell"), 1.0)), states=(("eyes", "Shut"),)
)
STARTS = CounterexampleStep(Kind.START, "look starts", execution=LOOK, states=(("eyes", "Open"),), running=(LOOK,))


ONE_MORE = "1 executions of look run in the managers, 0 in the counterexample"


def interrupted(number: int) -> CounterexampleStep:
    """Return the step in which what runs is interrupted."""
    execution = replace(LOOK, number=number)
    ended = (CounterexampleEnd(execution, "INTERRUPTED"),)
    return CounterexampleStep(Kind.INTERRUPT, "look is interrupted", execution=execution, ended=ended, states=(("eyes", "Shut"),))


def told_of(tmp_path, *steps: CounterexampleStep) -> list[tuple[int, tuple[str, ...]]]:
    """Return the differences of a run of the watching skillset, each with the number of its step."""
    skillset, _ = counterexamples(tmp_path / "example.rl", DATA)
    return differences(skillset, Counterexample(steps))


def test_a_run_by_hand_plays_with_an_interrupt_and_a_refusal(tmp_path):
    again = replace(STARTS, execution=replace(LOOK, number=2), running=())
    stale = CounterexampleStep(Kind.DATA, "fps gets old", data=((("fps",), None),), states=(("eyes", "Shut"),))
    assert told_of(tmp_path, SEES, STARTS, interrupted(1), stale, replace(again, refused=True, states=stale.states)) == []


def test_a_start_that_is_refused_in_the_counterexample_only_is_told(tmp_path):
    refused = replace(STARTS, refused=True, states=SEES.states, running=())
    assert told_of(tmp_path, SEES, refused)[0] == (2, ("look starts", "eyes is Open in the managers, Shut in the counterexample", ONE_MORE))


def test_what_does_not_run_in_both_is_told_and_the_play_ends_there(tmp_path):
    unseen = replace(STARTS, running=())
    assert told_of(tmp_path, SEES, unseen, unseen) == [(2, (ONE_MORE,))]
    unplayed = replace(STARTS, running=(LOOK, replace(LOOK, number=2)))
    assert told_of(tmp_path, SEES, unplayed) == [(2, ("1 executions of look run in the managers, 2 in the counterexample",))]


def test_a_break_without_values_can_not_be_played(tmp_path):
    step = CounterexampleStep(Kind.BREAK, "power breaks", states=STARTS.states, running=(LOOK,))
    assert told_of(tmp_path, SEES, STARTS, step) == [(3, ("no values of data are known that break the invariant",))]


def test_a_field_that_a_step_leaves_out_stays(tmp_path):
    """The level of the battery stays enough for longer than its invariant would wait, while only a cell and the rate are told."""
    stay = {"states": STARTS.states, "running": (LOOK,)}
    cell = CounterexampleStep(Kind.DATA, "a cell", data=((("battery", "cell"), 0.5),), **stay)
    later = CounterexampleStep(Kind.TIME, "time passes", time_s=0.9, **stay)
    rate = CounterexampleStep(Kind.DATA, "the rate", data=((("fps",), 30.0),), **stay)
    assert told_of(tmp_path, SEES, STARTS, cell, *(later, rate) * 5) == []


def test_a_skill_that_makes_progress_goes_on_for_any_time(tmp_path):
    skillset, _ = counterexamples(
        tmp_path / "example.rl", "skillset s { skill look { progress { period 1 sec deadline 2 sec } success DONE } }"
    )
    start = CounterexampleStep(Kind.START, "look starts", execution=LOOK, running=(LOOK,))
    later = CounterexampleStep(Kind.TIME, "time passes", time_s=60.0, running=(LOOK,))
    assert differences(skillset, Counterexample((start, later))) == []


@pytest.mark.parametrize("text", [*EXAMPLES.values(), DATA, OUTSIDE])
def test_steps_cross_as_json(text, tmp_path):
    _, findings = counterexamples(tmp_path / "example.rl", text)
    for step in (step for finding in findings for step in finding.counterexample.steps):
        assert CounterexampleStep.from_json(json.loads(json.dumps(step.as_json()))) == step


def test_the_command(tmp_path, capsys):
    path = tmp_path / "example.rl"
    path.write_text(EXAMPLES["ALU510"])
    assert check.main(["--play", "1", str(path)]) == 0
    assert capsys.readouterr().out.endswith("the managers do the same\n")
    assert check.main(["--play", "1", "--json", str(path)]) == 0
    assert json.loads(capsys.readouterr().out)["agrees"]
    assert check.main(["--play", "2", str(path)]) == 2
    assert "there is no counterexample 2" in capsys.readouterr().err
