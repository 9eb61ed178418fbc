"""What the proofs say of whole models: the journal's goto, data, durations, fairness, the vehicle's own skillsets."""

from __future__ import annotations

import itertools
import json
from dataclasses import replace

import pytest
from test_prove_page import FOLDER, proved

from alula.language.load import check_file
from alula.model.expressions import Comparison, DataIs, ResourceIs, SkillRuns
from alula.model.model import (
    Assignment,
    Effect,
    Hold,
    Interrupt,
    Invariant,
    Precondition,
    Property,
    PropertyKind,
    Resource,
    Result,
    Skill,
    Skillset,
    Transition,
)
from alula.prove import limits
from alula.prove.skillset import sets
from alula.prove.skillset.prover import prove
from prove_bench import skillsets as bench

BOTH = pytest.mark.parametrize("most", [2000, 0], ids=["one by one", "as sets"])
GOTO = """
skillset uav {
  resource authority {
    state { Pilot Drone None }
    initial Pilot
    transition { Pilot -> None  None -> Pilot  None -> Drone  Drone -> Pilot  Drone -> None }
  }
  event lost { guard authority == Pilot  effect authority -> None }
  event given { guard authority == None  effect authority -> Drone }
  event taken { guard authority == Drone  effect authority -> Pilot }
  skill goto {
    precondition { not_pilot: authority != Pilot }
    invariant { in_control { guard authority == Drone } }
    success arrived
  }
}
"""


@BOTH
def test_goto_loses_its_invariant_right_after_the_start(most, tmp_path):
    (finding,) = proved(tmp_path, GOTO, most=most)
    assert (finding.code, finding.severity.value, finding.counterexample_lines[0]) == ("ALU510", "error", "authority == None")
    assert finding.counterexample_lines[1:] == (
        "1. initially authority == Pilot",
        "2. event lost: authority Pilot -> None",
        "3. goto starts; `in_control` of goto is false and ends it",
    )
    assert finding.as_json()["counterexample"] == list(finding.counterexample_lines)


ARM = Resource("arm", ("In", "Out"), "In", (Transition("In", "Out"), Transition("Out", "In")))
GIVE = Effect("", (Assignment("arm", "In"),))


def reaching(*preconditions, invariants=(), **changes):
    skill = Skill(
        "reach",
        preconditions=(Precondition("rest", ResourceIs("arm", "In")), *preconditions),
        start=Effect("", (Assignment("arm", "Out"),)),
        invariants=(Invariant("out", ResourceIs("arm", "Out")), *invariants),
        interrupt=Interrupt(effect=GIVE),
        results=(Result("OK", effect=GIVE),),
    )
    return Skillset("arm", resources=(ARM,), skills=(skill,), **changes)


def level(comparison, value, unit=""):
    return DataIs("battery", ("level",), comparison, value, unit)


@BOTH
def test_data_exclude_each_other_by_their_values_and_units(most):
    full, empty = Precondition("full", level(Comparison.GT, 30.0, "%")), Precondition("empty", level(Comparison.LT, 0.2))
    assert {"ALU504", "ALU522"} <= {f.code for f in prove(reaching(full, empty), most=most)}
    assert prove(reaching(full), most=most) == []
    kept = Invariant("charged", level(Comparison.GT, 0.2), GIVE)
    assert prove(reaching(full, invariants=[kept]), most=most) == []
    (finding,) = prove(reaching(invariants=[kept]), most=most)
    assert finding.code == "ALU510"
    assert finding.counterexample_lines[1].startswith("battery.level == ")
    assert float(finding.counterexample_lines[1].split("== ")[1]) <= 0.2


@BOTH
def test_an_invariant_that_holds_for_some_time_may_break_later_and_its_effect_is_applied(most):
    steady = Invariant("steady", level(Comparison.GT, 0.2), GIVE, Hold(2.0))
    wanted = Property("stays", PropertyKind.NEVER, ResourceIs("arm", "Out"))
    (finding,) = prove(reaching(invariants=[steady], properties=(wanted,)), most=most)
    assert finding.code == "ALU531"
    keeps = replace(steady, effect=Effect())
    lost = prove(reaching(invariants=[keeps]), most=most)
    assert [f.code for f in lost] == ["ALU524"]
    assert lost[0].counterexample_lines[-1] == "5. 2 s pass; `steady` of reach is false and ends it"


@BOTH
def test_only_fairness_makes_an_execution_end(most):
    toggle = Resource("day", ("Yes", "No"), "Yes", (Transition("Yes", "No", extern=True), Transition("No", "Yes", extern=True)))
    ends = Property("ends", PropertyKind.LEADS_TO, SkillRuns("reach"), ResourceIs("arm", "In"))
    model = replace(reaching(properties=(ends,)), resources=(ARM, toggle))
    (finding,) = prove(model, most=most)
    assert finding.code == "ALU531"
    loop = finding.counterexample_lines[finding.counterexample_lines.index("and then for ever:") + 1 :]
    assert sorted(line.split(": ")[-1] for line in loop) == ["day No -> Yes", "day Yes -> No"]
    assert prove(replace(model, properties=(replace(ends, fair=True),)), most=most) == []


def test_the_vehicles_skillsets_are_proved():
    skillsets = [check_file(path)[0] for path in sorted((FOLDER / "uav").glob("*.skill"))]
    assert len(skillsets) == 4
    findings = [finding for skillset in skillsets for finding in prove(skillset)]
    # The paper's takeoff keeps the axes when it loses the authority (see the comment in the model).
    assert [finding.code for finding in findings] == ["ALU524"]
    assert "`keep_sdk_authority` of takeoff is false and ends it" in findings[0].counterexample_lines[-1]


def test_a_long_search_says_what_it_is_doing(monkeypatch):
    monkeypatch.setattr(limits, "EVERY_S", 0.0)
    told = []
    assert prove(bench.sparse(6), most=0, timeout_s=600, on_progress=told.append) == []
    stages = {"each block alone", "situations one by one", "properties, with a few skills", "situations as sets"}
    assert {line.split(";")[0] for line in told} == stages


def test_a_sparse_skillset_is_proved_by_the_skills_around_its_property(monkeypatch):
    """Time is counted by questions for it, a millisecond each: the same on every machine."""
    questions = itertools.count()
    monkeypatch.setattr(limits.time, "monotonic", lambda: next(questions) / 1000)
    assert prove(bench.sparse(200), most=0, timeout_s=120) == []


def test_what_the_skills_around_a_property_do_not_bring_about_is_refuted(monkeypatch):
    monkeypatch.setattr(sets, "MOST_NODES", 0)
    wanted = Property("other", PropertyKind.LEADS_TO, SkillRuns("use0"), ResourceIs("part1", "Used"), fair=True)
    (finding,) = prove(replace(bench.sparse(4), properties=(wanted,)), most=0, timeout_s=600)
    assert (finding.code, "`other`" in finding.message) == ("ALU531", True)


def test_the_benchmark_measures(capsys):
    assert bench.main(["--one", "neighbours", "6", "sets", "--timeout", "20"]) == 0
    row = json.loads(capsys.readouterr().out)
    assert (row["family"], row["size"], row["proved"], row["findings"]) == ("neighbours", 6, True, [])
    assert row["seconds"] > 0


def test_the_benchmark_tells_each_line_and_writes_what_it_measured(capsys, tmp_path):
    path = tmp_path / "bench.json"
    assert bench.main(["--sizes", "2", "--json", str(path), "--timeout", "60"]) == 0
    rows = json.loads(path.read_text())["proofs"]
    assert [(row["family"], row["method"], row["size"], row["proved"]) for row in rows] == [
        ("tools", "one by one", 2, True),
        ("tools", "sets", 2, True),
        ("neighbours", "one by one", 2, True),
        ("neighbours", "sets", 2, True),
        ("sparse", "one by one", 2, True),
        ("sparse", "sets", 2, True),
    ]
    assert len(capsys.readouterr().out.splitlines()) == 7
