"""What attacks from outside have found: each defect as a test of its class."""

from __future__ import annotations

import io
import json
import os

import pytest

from alula.cli import check
from alula.language.counterexamples import NumberedExecution, StepKind
from alula.language.models import check_files
from alula.prove.skillset.prover import prove

BOTH = pytest.mark.parametrize("most", [2000, 0], ids=["one by one", "as sets"])


def proved(tmp_path, text, **options):
    path = tmp_path / "example.rl"
    path.write_text(text)
    (file,) = check_files([path])
    assert not [finding for finding in file.findings if finding.severity.value == "error"], file.findings
    return prove(file.skillsets[0], **options)


def checked(tmp_path, *texts):
    paths = [tmp_path / f"m{number}.rl" for number in range(len(texts))]
    for path, text in zip(paths, texts, strict=True):
        path.write_text(text)
    return [[(finding.code, finding.span.line) for finding in file.findings] for file in check_files(paths)]


# --- a transition not taken -----------------------------------------------------------------------------------------------

GOTO = """
skillset uav {
  resource authority {
    state { Pilot Drone None }
    initial Pilot
    transition { Pilot -> None  None -> Pilot  None -> Drone  Drone -> Pilot  Drone -> None }
  }
  skill goto {
    precondition { not_pilot: authority != Pilot }
    invariant { in_control { guard authority == Drone } }
    success arrived
  }
  property with_control: always goto running => authority == Drone
  property pilot: always authority == Pilot
}
"""


@BOTH
def test_what_only_an_untaken_transition_leads_to_is_an_error(most, tmp_path):
    errors = [f for f in proved(tmp_path, GOTO, most=most) if f.severity.value == "error"]
    assert [f.code for f in errors] == ["ALU510", "ALU531"]
    assert errors[0].counterexample_lines == (
        "authority == None",
        "1. initially authority == Pilot",
        "2. from outside: authority Pilot -> None",
        "3. goto starts; `in_control` of goto is false and ends it",
    )
    assert errors[0].counterexample.steps[1].kind is StepKind.OUTSIDE
    assert "`--closed-world`" in errors[0].hint
    assert "`pilot`" in errors[1].message


@BOTH
def test_in_a_closed_world_it_is_a_warning(most, tmp_path):
    findings = proved(tmp_path, GOTO, most=most, closed_world=True)
    assert {f.severity.value for f in findings} == {"warning"}
    assert "no reachable situation shows it" in next(f.message for f in findings if f.code == "ALU510")


def test_the_command_line_asks_for_a_closed_world(tmp_path, capsys):
    path = tmp_path / "uav.rl"
    path.write_text(GOTO)
    assert check.main([str(path)]) == 1
    assert check.main([str(path), "--closed-world"]) == 0
    assert "from outside" not in capsys.readouterr().out.split("uav.rl: 2 errors")[1]


# --- time -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("states", [120, 250])
def test_a_resource_of_many_states_is_proved_in_the_time_given(states, tmp_path):
    names = " ".join(f"S{number}" for number in range(states))
    text = f"""skillset big {{
      resource r {{ state {{ {names} }} initial S0 transition all }}
      skill f {{
        precondition {{ a: r == S0 }}
        start r -> S1
        invariant {{ i {{ guard r == S1 effect r -> S0 }} }}
        interrupt {{ effect r -> S0 }}
        success DONE {{ effect r -> S0 }}
      }}
    }}"""
    findings = proved(tmp_path, text, timeout_s=60.0)
    assert "ALU540" not in {f.code for f in findings}
    (unreached,) = [f for f in findings if f.code == "ALU521"]
    assert unreached.message == f"`r` never gets to `S2`, `S3`, `S4`, `S5`, `S6`, `S7` and {states - 8} more"


def test_transitions_of_a_file_are_bounded(tmp_path):
    names = " ".join(f"S{number}" for number in range(250))
    resources = "\n".join(f"resource r{k} {{ state {{ {names} }} initial S0 transition all }}" for k in range(40))
    (found,) = checked(tmp_path, f"skillset big {{\n{resources}\n}}")
    assert {code for code, _ in found} == {"ALU109"}


# --- what is no file --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("path", ["/dev/zero", "/dev/random", "/dev/stdin"])
def test_what_is_no_regular_file_is_refused_unread(path, capsys):
    assert check.main([path]) == 2
    assert "ALU001" in capsys.readouterr().out


def test_a_pipe_without_a_writer_is_refused(tmp_path, capsys):
    os.mkfifo(tmp_path / "pipe.skill")
    assert check.main([str(tmp_path / "pipe.skill")]) == 2
    assert "no regular file" in capsys.readouterr().out


class Endless(io.RawIOBase):
    """Gives zeros without end."""

    def read(self, size=-1):
        assert 0 < size < 10_000_000
        return b"\0" * size


def test_the_standard_input_is_read_to_the_limit(monkeypatch, capsys):
    class Input:
        buffer = io.BytesIO(b"skillset s { skill f { success OK } }")

    monkeypatch.setattr("sys.stdin", Input)
    assert check.main(["-"]) == 0
    assert capsys.readouterr().out == "<standard input>: ok\n"
    Input.buffer = Endless()
    assert check.main(["-"]) == 2
    assert "ALU003" in capsys.readouterr().out


def test_a_folder_stands_for_its_models(tmp_path, capsys):
    (tmp_path / "a.rl").write_text("skillset a { }")
    (tmp_path / "b.skill").write_text("skillset b { }")
    assert check.main([str(tmp_path)]) == 0
    assert [line.rpartition("/")[2] for line in capsys.readouterr().out.splitlines()] == ["a.rl: ok", "b.skill: ok"]
    (tmp_path / "none").mkdir()
    assert check.main([str(tmp_path / "none")]) == 2
    assert "ALU006" in capsys.readouterr().out


# --- types and names --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "condition"),
    [
        ("uint8", "n > 300"),
        ("uint8", "n < 0"),
        ("uint8", "n == 2.5"),
        ("int8", "n < -128"),
        ("int64", "n > 1 and n < 2"),
        ("uint16", "n == 65536"),
    ],
)
def test_no_integer_is_outside_of_the_range_of_its_type(kind, condition, tmp_path):
    text = f"skillset s {{ data n: {kind} skill f {{ precondition {{ p: {condition} }} success OK }} }}"
    assert {f.code for f in proved(tmp_path, text)} == {"ALU504", "ALU522"}
    assert proved(tmp_path, text.replace(kind, "float64")) == []


def test_what_any_value_fulfils_may_still_lack_one(tmp_path):
    text = "skillset s { data n: uint8 skill f { invariant { alive { guard n >= 0 } } success OK } }"
    codes = {f.code: f for f in proved(tmp_path, text)}
    assert codes["ALU508"].severity.value == "warning"
    assert "no fresh value" in codes["ALU508"].message


def test_names_are_defined_once(tmp_path):
    use = "skillset s { data a: A }"
    assert checked(tmp_path, f"type A\ntype A\n{use}") == [[("ALU201", 2)]]
    assert checked(tmp_path, f"type A type B\ntype A\n{use}\nskillset t {{ data b: B }}") == [[("ALU201", 2)]]
    assert checked(tmp_path, f"type A\n{use}\n{use}") == [[("ALU404", 3)]]
    assert checked(tmp_path, f"type A\n{use}", f"type A\n{use}") == [[], [("ALU404", 2)]]


# --- counterexamples ----------------------------------------------------------------------------------------------------------

FAILING = """
skillset s {
  resource gear {
    state { Up Moving Down }
    initial Up
    transition { Up -> Moving  Moving -> Down  Down -> Up }
  }
  event retracted { guard gear == Down  effect gear -> Up }
  skill lower {
    precondition { up: gear == Up }
    start gear -> Moving
    invariant { moving { guard gear == Moving } }
    interrupt { effect gear -> Down }
    success done { effect gear -> Up }
  }
}
"""


@BOTH
def test_an_end_that_fails_tells_whose_effect_is_applied(most, tmp_path):
    (finding,) = proved(tmp_path, FAILING, most=most)
    assert finding.code == "ALU513"
    assert finding.counterexample_lines[-1] == (
        "3. lower ends with done; the effect of `done` of lower is no transition from here, so it ends as FAILED"
        " with the effect of its interruption: gear Moving -> Down"
    )
    last = finding.counterexample.steps[-1]
    assert (last.ended[0].state, last.subject) == ("FAILED", ("lower", "done"))


RECOVERS = """
skillset s {
  data fps: float64
  skill watch {
    precondition { sees: fps >= 10 }
    invariant { sees { guard fps >= 10 recovers at 12 } }
    success DONE
  }
}
"""


@BOTH
def test_a_counterexample_names_the_values_that_decide(most, tmp_path):
    (finding,) = proved(tmp_path, RECOVERS, most=most)
    assert finding.code == "ALU510"
    first, low, between, start = finding.counterexample.steps
    assert (first.kind, low.kind, between.kind, start.kind) == (StepKind.INITIALLY, StepKind.DATA, StepKind.DATA, StepKind.START)
    ((path, value),) = low.data
    assert path == ("fps",)
    assert value < 10
    assert 10 <= between.data[0][1] < 12
    assert [(e.execution, e.state, e.name) for e in start.ended] == [(NumberedExecution("watch", 1), "RESOURCE_INVARIANT_VIOLATED", "sees")]
    assert start.running == ()


@BOTH
def test_a_hint_helps(most, tmp_path):
    text = """skillset s {
      resource r { state { A B } initial A transition { A -> B  B -> A } }
      skill f { precondition { a: r == A } start r -> B invariant { a { guard r == A effect r -> A } } success OK }
    }"""
    (finding,) = [f for f in proved(tmp_path, text, most=most) if f.code == "ALU510"]
    assert finding.hint == "no start of `f` ever fulfils it: change the invariant, or the state that the start effect leads to"


TWICE = """
skillset s {
  resource r { state { A B C } initial A transition { A -> B  B -> C } }
  skill f { interrupt { effect r -> B } success OK { effect r -> C } }
  property two: never r == C
}
"""


@BOTH
def test_executions_of_one_skill_are_told_apart(most, tmp_path):
    finding = next(f for f in proved(tmp_path, TWICE, most=most) if f.code == "ALU531")
    numbers = [(step.execution.number, step.text) for step in finding.counterexample.steps[1:]]
    assert [number for number, _ in numbers] in ([1, 1, 2, 2], [1, 2, 1, 2], [1, 2, 2, 1])
    assert any("(execution 2)" in text for _, text in numbers) or [number for number, _ in numbers] == [1, 1, 2, 2]


def test_steps_are_in_the_json(tmp_path, capsys):
    path = tmp_path / "s.rl"
    path.write_text(RECOVERS)
    assert check.main([str(path), "--json"]) == 1
    (finding,) = json.loads(capsys.readouterr().out)["files"][0]["findings"]
    last = finding["steps"][-1]
    assert (last["kind"], last["skill"], last["execution"], last["running"]) == ("start", "watch", 1, [])
    assert last["ended"] == [{"skill": "watch", "execution": 1, "state": "RESOURCE_INVARIANT_VIOLATED", "name": "sees"}]
    assert [set(step["data"]) for step in finding["steps"]] == [set(), {"fps"}, {"fps"}, set()]
    assert [f"{number}. {step['text']}" for number, step in enumerate(finding["steps"], 1)] == finding["counterexample"][1:]


# --- places and messages ------------------------------------------------------------------------------------------------

PLACES = [
    ("skillset s {\n  use other\n}", "ALU224", (2, 7, 12), "uses `other`"),
    (
        "skillset s { resource r { state { A B } initial A transition all }\nskill f { start r -> C success OK } }",
        "ALU203",
        (2, 22, 23),
        "`C`",
    ),
    (
        "skillset s { resource r { state { A B } initial A transition all }\nskill f { start q -> A success OK } }",
        "ALU202",
        (2, 17, 18),
        "`q`",
    ),
    ("skillset s { resource r { state { A B } initial A transition { A -> B  B -> Ce } } }", "ALU203", (1, 77, 79), "`Ce`"),
    (
        "skillset s { resource r { state { A B } initial A transition all }\nskill f { start { r -> A r -> B } success OK } }",
        "ALU212",
        (2, 26, 32),
        "the effect sets `r` twice",
    ),
    (
        "skillset s { resource r { state { A B } initial A transition all }\n"
        "skill f {\nprecondition { p: r == A\nstart r -> B\nsuccess OK } }",
        "ALU104",
        (4, 1, 6),
        "the block opened in line 3 has no `}` before `start` begins",
    ),
    (
        "skillset s {\ndata fps: float64 period 1 s // Hz, shown to the pilot\nskill f { invariant i: fps >= 1 km success OK } }",
        "ALU225",
        (3, 33, 35),
        "`fps` is compared in `km`, a length, but is in `Hz`, a frequency",
    ),
    (
        "skillset s { type B data b: B\nskill f { precondition p: b.high > 3 m\ninvariant i: b.high < 9 m recovers at (2 s) success OK } }",
        "ALU225",
        (3, 42, 43),
        "`b.high` is compared in `s`, a time, but is in `m`, a length",
    ),
    ("skillset s { data d: float64\nskill f { precondition p: d > 3 furlong/h success OK } }", "ALU103", (2, 33, 40), "found `furlong`"),
    ("skillset s { data d: float64\nskill f { precondition p: (d > 3 furlong/h) success OK } }", "ALU219", (2, 34, 43), "`furlong/h`"),
    ("skillset s {\n  data fps\n}", "ALU103", (3, 1, 2), "expected `:`"),
    (f"skillset s {{ data {'a' * 5000}: bool }}", "ALU110", (1, 19, 219), "a name of 5000 characters"),
]


@pytest.mark.parametrize(("text", "code", "place", "told"), PLACES, ids=[f"{code} {told[:20]}" for _, code, _, told in PLACES])
def test_a_finding_is_where_the_fault_is(text, code, place, told, tmp_path):
    (tmp_path / "s.rl").write_text(text)
    (file,) = check_files([tmp_path / "s.rl"])
    finding = next(one for one in file.findings if one.code == code)
    assert (finding.span.line, finding.span.column, finding.span.end_column) == place
    assert told in finding.message
    assert "``" not in finding.render()
    assert len(finding.render()) < 1500


def test_hints_name_the_notation_and_what_can_be_asked(tmp_path):
    paper = "skillset s { resource r { initial A  A -> B  B -> A } skill f { precondition { p: resource = (r == A) } result { R } } }"
    (tmp_path / "s.rl").write_text(paper.replace("result { R }", "effect { e: r -> A } result { R: apply = e }"))
    (file,) = check_files([tmp_path / "s.rl"])
    assert file.findings[0].hint == "the text reads well in the paper's notation: name the file *.skill"
    (tmp_path / "s.rl").write_text("skillset s { skill f { precondition { p: a.r == A } success OK } }")
    (file,) = check_files([tmp_path / "s.rl"])
    assert "those of another skillset can't be asked" in file.findings[0].hint


def test_units_of_one_kind_go_together(tmp_path):
    text = """skillset s {
      data way: float64 // m, since the start
      data rate: float64 // min and max in turn: no unit
      data battery: float64
      skill f { precondition { a: way > 1 km  b: way > 3  c: rate > 3 m  d: battery > 20 %  e: battery < 12 V } success OK }
    }"""
    assert checked(tmp_path, text) == [[("ALU225", 5)]]
    assert checked(tmp_path, text.replace("12 V", "12 %")) == [[]]


def test_a_wait_that_is_shorter_than_the_period_of_its_data_is_told(tmp_path):
    text = "skillset s { data fps: float64 period 5 s skill f { invariant { i { guard fps > 10 for 1 ms } } success OK } }"
    assert checked(tmp_path, text) == [[("ALU305", 1)]]
    assert checked(tmp_path, text.replace("1 ms", "6 s")) == [[]]
