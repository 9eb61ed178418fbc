"""The paper's listings read as printed, and the scanning damage of our copy is told where it is."""

from __future__ import annotations

import pytest

from alula.language.errors import LanguageError
from alula.language.paper import parse
from alula.model.expressions import And, Comparison, Constant, DataIs, Implies, Not, Or, ResourceIs
from alula.model.model import (
    Assignment,
    Effect,
    Interrupt,
    Invariant,
    Parameter,
    Precondition,
    Progress,
    Resource,
    Result,
    Skill,
    Transition,
)

LISTING_2 = """
resource
axes_authority {
initial
AVAILABLE
AVAILABLE ->
USED
USED ->
AVAILABLE
}
"""

LISTING_3 = """skill takeoff {
     progress = 0.5
     input {
       height: float64 // < h_geo_fence
       speed :
                float64
     }
     effect {
       take_control: axes_authority -> USED
       release_control: axes_authority -> AVAILABLE
       reset {}
     }
     precondition {
       sdk_authority:
        resource = (SDK_authority==AVAILABLE)
       not_moving: resource = (axes_authority == AVAILABLE)
       on_ground: resource = (flight_status ==ON_GROUND)
home_valid: resource = (homepoint_status ==VALID)
       success take_control
     }
     invariant {
       keep_sdk_authority:
        resource =(SDK_authority==AVAILABLE)
        violation=reset
       in_control: resource=(axes_authority==USED)
        violation=reset
    }
     result {
       AT_ALTITUDE: apply=release_control
       BLOCKED: apply=release_control
       ABORTED: apply=release_control // too big drift
    }
  }
"""

TAKE = Effect("take_control", (Assignment("axes_authority", "USED"),))
RELEASE = Effect("release_control", (Assignment("axes_authority", "AVAILABLE"),))
RESET = Effect("reset")

TAKEOFF = Skill(
    name="takeoff",
    inputs=(Parameter("height", "float64", comment="< h_geo_fence"), Parameter("speed", "float64")),
    effects=(TAKE, RELEASE, RESET),
    preconditions=(
        Precondition("sdk_authority", ResourceIs("SDK_authority", "AVAILABLE")),
        Precondition("not_moving", ResourceIs("axes_authority", "AVAILABLE")),
        Precondition("on_ground", ResourceIs("flight_status", "ON_GROUND")),
        Precondition("home_valid", ResourceIs("homepoint_status", "VALID")),
    ),
    start=TAKE,
    invariants=(
        Invariant("keep_sdk_authority", ResourceIs("SDK_authority", "AVAILABLE"), RESET),
        Invariant("in_control", ResourceIs("axes_authority", "USED"), RESET),
    ),
    progress=Progress(0.5),
    results=(
        Result("AT_ALTITUDE", effect=RELEASE),
        Result("BLOCKED", effect=RELEASE),
        Result("ABORTED", effect=RELEASE, comment="too big drift"),
    ),
)


def wrapped(body: str):
    return parse(f"skillset navigation {{\n{body}\n}}", "navigation.skill")


def test_listing_2():
    transitions = (Transition("AVAILABLE", "USED"), Transition("USED", "AVAILABLE"))
    assert wrapped(LISTING_2).resources == (Resource("axes_authority", ("AVAILABLE", "USED"), "AVAILABLE", transitions),)


def test_listing_3():
    assert wrapped(LISTING_3).skills == (TAKEOFF,)


def test_places_are_those_of_the_source():
    skill = wrapped(LISTING_3).skill("takeoff")
    assert str(skill.span) == "navigation.skill:2:7"
    assert (skill.inputs[0].span.line, skill.inputs[0].span.column, skill.inputs[0].span.end_column) == (5, 8, 23)
    assert (skill.start.span.line, skill.start.span.column) == (20, 16)
    assert (skill.preconditions[0].condition.span.line, skill.preconditions[0].condition.span.end_column) == (16, 45)


def test_scanning_damage_is_told_where_it_is():
    damaged = LISTING_3.replace("     }\n     effect", "     effect").replace("result {", "result |")
    damaged = damaged.replace("sdk_authority:\n", "sdk_authority\n", 1)
    with pytest.raises(LanguageError) as caught:
        wrapped(damaged)
    told = [(d.code, d.span.line, d.span.column) for d in caught.value.diagnostics]
    assert told == [("ALU104", 8, 6), ("ALU103", 15, 9), ("ALU100", 28, 13), ("ALU103", 29, 8)]


def test_extern_transitions_and_states_in_order():
    resource = wrapped("resource zed { initial UNKNOWN extern UNKNOWN -> OK extern OK -> BROKEN BROKEN -> OK }").resource("zed")
    assert resource.states == ("UNKNOWN", "OK", "BROKEN")
    assert resource.has_transition("OK", "BROKEN", extern=True)
    assert not resource.has_transition("OK", "BROKEN", extern=False)
    assert resource.has_transition("BROKEN", "OK", extern=False)


def test_transition_all_is_for_skills_and_extern_all_for_the_functional_layer():
    resource = wrapped("resource r { state { A B C } initial B transition all }").resource("r")
    assert resource.states == ("A", "B", "C")
    assert resource.all_transitions
    assert len(resource.transitions) == 9
    assert not any(transition.extern for transition in resource.transitions)
    assert resource.has_transition("C", "A", extern=False)
    assert resource.has_transition("A", "A", extern=False)
    both = wrapped("resource r { state { A B C } initial B transition { all  extern all } }").resource("r")
    assert len(both.transitions) == 15
    assert both.has_transition("C", "A", extern=True)
    assert not both.has_transition("A", "A", extern=True)


def test_data_with_and_without_period():
    skillset = wrapped("type { Battery Pose } data battery: Battery period = 0.5 data { pose: Pose height: float64 period = 1 }")
    assert skillset.types == ("Battery", "Pose")
    assert [(d.name, d.type, d.period_s) for d in skillset.data] == [
        ("battery", "Battery", 0.5),
        ("pose", "Pose", None),
        ("height", "float64", 1.0),
    ]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("resource = (a == S)", ResourceIs("a", "S")),
        ("resource = (a != S)", ResourceIs("a", "S", negated=True)),
        ("resource = (not a == S)", Not(ResourceIs("a", "S"))),
        (
            "resource = (a == S and b == T or c == U)",
            Or((And((ResourceIs("a", "S"), ResourceIs("b", "T"))), ResourceIs("c", "U"))),
        ),
        (
            "resource = (a == S and (b == T or c == U))",
            And((ResourceIs("a", "S"), Or((ResourceIs("b", "T"), ResourceIs("c", "U"))))),
        ),
        (
            "resource = (a == S => b == T => c == U)",
            Implies(ResourceIs("a", "S"), Implies(ResourceIs("b", "T"), ResourceIs("c", "U"))),
        ),
        ("resource = ((a == S and b == T) and c == U)", And((And((ResourceIs("a", "S"), ResourceIs("b", "T"))), ResourceIs("c", "U")))),
        ("data = (battery.level > 0.2)", DataIs("battery", ("level",), Comparison.GT, 0.2)),
        ("data = (battery.level >= -20 %)", DataIs("battery", ("level",), Comparison.GE, -20.0, "%")),
        ("data = (speed.x <= 7.5 km/h and true)", And((DataIs("speed", ("x",), Comparison.LE, 7.5, "km/h"), Constant(value=True)))),
        ("data = (age < 2 sec)", DataIs("age", (), Comparison.LT, 2.0, "sec")),
        ('data = (mode == "GUI\\"DED")', DataIs("mode", (), Comparison.EQ, 'GUI"DED')),
        ("data = (health.ok)", DataIs("health", ("ok",), Comparison.EQ, value=True)),
        ("data = (health.ok != false)", DataIs("health", ("ok",), Comparison.NE, value=False)),
        (
            "resource = (a == S) and not data = (level > 1)",
            And((ResourceIs("a", "S"), Not(DataIs("level", (), Comparison.GT, 1.0)))),
        ),
    ],
)
def test_conditions(text, expected):
    skill = wrapped(f"skill f {{ precondition {{ p: {text} }} }}").skill("f")
    assert skill.preconditions == (Precondition("p", expected),)


def test_beyond_the_listing():
    skill = wrapped(
        """skill f {
          output { travelled: float64 // metres
          }
          effect { take { a -> S b -> T } give: a -> R }
          precondition { success take }
          invariant { safe: resource = (c == OK) }
          interrupt { apply = give post resource = (a == R) }
          result { DONE: apply = give post resource = (b == T) // good
            LOST // no signal
          }
        }"""
    ).skill("f")
    take, give = Effect("take", (Assignment("a", "S"), Assignment("b", "T"))), Effect("give", (Assignment("a", "R"),))
    assert skill.outputs == (Parameter("travelled", "float64", comment="metres"),)
    assert skill.start == take
    assert skill.invariants == (Invariant("safe", ResourceIs("c", "OK")),)
    assert skill.interrupt == Interrupt(effect=give, postcondition=ResourceIs("a", "R"))
    done = Result("DONE", effect=give, postcondition=ResourceIs("b", "T"), comment="good")
    assert skill.results == (done, Result("LOST", comment="no signal"))


def test_words_of_the_language_are_names_where_no_doubt_is():
    skillset = wrapped(
        """resource state { initial initial  initial -> extern  extern -> initial }
           skill success { input { data: float64 resource: float64 }
             effect { violation: state -> extern  success { } }
             precondition { success: resource = (state == initial)  violation: data = (data > 1)  success violation }
             invariant { apply: resource = (state == extern) violation = success  violation: resource = (state != initial) }
             result { post: apply = violation  apply } }"""
    )
    assert skillset.resource("state").states == ("initial", "extern")
    skill = skillset.skill("success")
    assert [p.name for p in skill.preconditions] == ["success", "violation"]
    assert [i.name for i in skill.invariants] == ["apply", "violation"]
    assert [r.name for r in skill.results] == ["post", "apply"]
    assert skill.start.name == "violation"
