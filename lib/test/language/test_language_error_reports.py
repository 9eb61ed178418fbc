"""What a user reads of findings: all of a file at once, in order, each with its line and a caret."""

from __future__ import annotations

import pytest

from alula.common.suggestions import nearest
from alula.language.errors import Diagnostic, LanguageError
from alula.language.paper import parse
from alula.model.span import Span


def test_several_errors_of_one_file_are_told_in_order():
    text = """skillset s {
  resource r { initial A  A > B }
  skill f {
    input { height float64 }
    effect { take: r -> B
    precondition { p: r == A }
  }
  skill g { progress 3 }
}"""
    with pytest.raises(LanguageError) as caught:
        parse(text, "x.skill")
    assert [(d.code, d.span.line) for d in caught.value.diagnostics] == [
        ("ALU103", 2),
        ("ALU103", 4),
        ("ALU104", 6),
        ("ALU103", 6),
        ("ALU103", 8),
    ]


def test_an_error_in_the_effects_does_not_make_more_of_their_users():
    with pytest.raises(LanguageError) as caught:
        parse("skillset s { skill f { effect { a: r = B  b: r -> A } result { R: apply = b } } }")
    assert [d.code for d in caught.value.diagnostics] == ["ALU103"]


def test_too_many_errors():
    text = "skillset s {\n" + "$\n" * 60 + "}"
    with pytest.raises(LanguageError) as caught:
        parse(text)
    assert [d.code for d in caught.value.diagnostics] == ["ALU100"] * 40 + ["ALU107"]


def test_rendering():
    text = "skillset s {\n\tskill f { precondition { p: resource = (a = B) } }\n}"
    with pytest.raises(LanguageError) as caught:
        parse(text, "models/x.skill")
    assert str(caught.value) == (
        "models/x.skill:2:44: error ALU103: expected `==` or `!=`, found `=`\n"
        "    2 | \tskill f { precondition { p: resource = (a = B) } }\n"
        "      | \t                                          ^\n"
        "      = expected one of `==`, `!=`\n"
        "      = hint: states are compared with `==`"
    )


def test_rendering_of_a_long_line_shows_its_place():
    line = "x" * 500 + "HERE" + "y" * 500
    lines = Diagnostic("ALU100", "m", Span("f", 1, 501, 505), source_line=line).render().split("\n")
    assert max(len(shown) for shown in lines) < 140
    assert lines[1][lines[2].index("^") :].startswith("HERE")
    assert lines[2].count("^") == 4


def test_rendering_without_a_place():
    assert Diagnostic("ALU001", "m").render() == "error ALU001: m"
    assert Diagnostic("ALU001", "m", Span("f.skill", 0, 0, 0)).render() == "f.skill: error ALU001: m"


def test_nearest():
    assert nearest("SDK_autority", ["SDK_authority", "axes_authority"]) == "did you mean `SDK_authority`?"
    assert nearest("available", ["AVAILABLE", "USED"]) == "did you mean `AVAILABLE`?"
    assert nearest("zzz", ["a", "b"]) == "there is `a`, `b`"
    assert nearest("zzz", [f"state_{i}" for i in range(20)]) == ""
    assert nearest("zzz", []) == ""
