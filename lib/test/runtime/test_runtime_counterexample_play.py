"""The counterexamples of the proofs, played in the managers: each comes to the end that it tells."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

from alula.commands import play as play_command
from alula.language.counterexamples import Counterexample, CounterexampleStep, StateChange
from alula.runtime.counterexample_play import play
from alula_testing.counterexamples import DATA, EXAMPLES, OUTSIDE, counterexamples


def differences(skillset, counterexample):
    return [(number, one.differences) for number, one in enumerate(play(skillset, counterexample), 1) if one.differences]


@pytest.mark.parametrize("code", sorted(EXAMPLES))
def test_every_counterexample_of_the_page_plays(code, tmp_path):
    skillset, findings = counterexamples(tmp_path / "example.rl", EXAMPLES[code])
    for finding in findings:
        assert differences(skillset, finding.counterexample) == [], finding.counterexample_lines


@pytest.mark.parametrize("text", [DATA, OUTSIDE], ids=["data and time", "from outside"])
def test_counterexamples_with_data_time_and_arrows_from_outside_play(text, tmp_path):
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


@pytest.mark.parametrize("text", [*EXAMPLES.values(), DATA, OUTSIDE])
def test_steps_cross_as_json(text, tmp_path):
    _, findings = counterexamples(tmp_path / "example.rl", text)
    for step in (step for finding in findings for step in finding.counterexample.steps):
        assert CounterexampleStep.from_json(json.loads(json.dumps(step.as_json()))) == step


def test_the_command(tmp_path, capsys):
    path = tmp_path / "example.rl"
    path.write_text(EXAMPLES["ALU510"])
    assert play_command.main(["--play", "1", str(path)]) == 0
    assert capsys.readouterr().out.endswith("the managers do the same\n")
    assert play_command.main(["--play", "1", "--json", str(path)]) == 0
    assert json.loads(capsys.readouterr().out)["agrees"]
    assert play_command.main(["--play", "2", str(path)]) == 2
    assert "there is no counterexample 2" in capsys.readouterr().err
