"""What an editor is told at a place, also while the line is broken; names and their places; indentation."""

from __future__ import annotations

from pathlib import Path

import pytest

from alula.editor import names
from alula.editor.completion import Place, completions
from alula.editor.occurrences import Entity, occurrences
from alula.language.layout import formatted
from alula.language.models import ModelFile, check_texts

MODELS = next(p / "skillsets" for p in Path(__file__).resolve().parents if (p / "skillsets" / "LANGUAGE.md").exists())
PAPER = """skillset s {
  type Point
  data battery: Point
  resource axes { initial FREE  FREE -> USED  USED -> FREE }
  skill goto {
    effect { take: axes -> USED  give: axes -> FREE }
    precondition { free: resource = (axes == FREE)  success take }
    invariant { mine: resource = (axes == USED)  violation = @ }
    result { DONE: apply = give }
  }
  property p: never axes == USED
}
"""
RL = """skillset s {
  type Point
  resource axes { state { FREE USED } initial FREE transition { FREE -> USED  USED -> FREE } }
  skill goto {
    effect take: axes -> USED
    start take
    success ok { effect axes -> FREE }
  }
  property p: never axes == USED
}
"""


def complete(text, file="s.skill"):
    """Return what may stand at the @ of a text."""
    line = text[: text.index("@")].count("\n")
    column = text.split("\n")[line].index("@")
    (read,) = check_texts([ModelFile(file, text.replace("@", ""))])
    return [one.label for one in completions(read, Place(line + 1, column + 1))]


PRIMITIVES = {"bool", "uint8", "float64", "string"}


def test_effects_behind_violation_and_apply_in_a_skill_that_can_not_be_read():
    assert complete(PAPER) == ["take", "give"]
    assert complete(PAPER.replace("violation = @", "").replace("apply = give", "apply = @")) == ["take", "give"]
    assert complete(PAPER.replace("violation = @", "").replace("success take", "success @")) == ["take", "give"]
    assert complete(RL.replace("start take", "start @"), "s.rl") == ["take", "axes"]


@pytest.mark.parametrize("text", [PAPER.replace("violation = @", ""), RL], ids=["paper", "rl"])
def test_states_types_and_words_of_properties(text):
    file = "s.skill" if text is not RL else "s.rl"
    assert complete(text.replace("never axes == USED", "never axes == @"), file) == ["FREE", "USED"]
    assert complete(text.replace("never axes == USED", "@"), file)[:3] == ["never", "always", "eventually"]
    words = complete(text.replace("never axes == USED", "never axes == USED @"), file)
    assert {"and", "or", "leads to", "assuming termination", "running"} <= set(words)
    assert complete(text.replace("never axes == USED", "axes == USED leads @"), file) == ["to"]
    typed = complete(text.replace("skill goto {", "skill goto { input { target: @ }"), file)
    assert typed[0] == "Point"
    assert set(typed) > PRIMITIVES
    assert "never" not in typed
    inside = complete(text.replace("resource axes {", "resource axes { extern FREE -> @ "), file)
    assert {"FREE", "USED"} <= set(inside)


def test_every_name_of_the_vehicle_leads_to_its_definition():
    files = check_texts([ModelFile(str(path), path.read_text()) for path in sorted((MODELS / "uav").glob("*.skill"))])
    for file in files:
        found = occurrences(file)
        lines = file.text.split("\n")
        assert len(found) > 20
        for one in found:
            assert lines[one.span.line - 1][one.span.column - 1 : one.span.end_column - 1] == one.entity.name
            places = files if one.entity.kind in names.SHARED else [file]
            assert any(names.definition(place, one.entity) for place in places), one


def test_a_new_name_changes_nothing_else():
    (file,) = check_texts([ModelFile("s.rl", RL)])
    for entity, name in (
        (Entity("state", "FREE", ("s", "axes")), "IDLE"),
        (Entity("skill", "goto", ("s",)), "go"),
        (Entity("effect", "take", ("s", "goto")), "t"),
    ):
        lines = RL.split("\n")
        for span in sorted(names.renamed([file], entity, name)[file.path], key=lambda one: -one.column):
            line = lines[span.line - 1]
            lines[span.line - 1] = line[: span.column - 1] + name + line[span.end_column - 1 :]
        assert "\n".join(lines) == RL.replace(entity.name, name)
        (again,) = check_texts([ModelFile("s.rl", "\n".join(lines))])
        assert again.findings == file.findings
    with pytest.raises(names.RenameError, match="is there already"):
        names.renamed([file], Entity("state", "FREE", ("s", "axes")), "USED")


ROLES = """skillset s {
  skill watch { provides eyes failure lost }
  skill go { needs eyes success ok }
}
"""


def test_a_role_is_completed_told_and_renamed():
    assert complete(ROLES.replace("needs eyes", "needs @"), "s.rl") == ["eyes"]
    assert complete(ROLES.replace("provides eyes", "provides { @ }"), "s.rl") == ["eyes"]
    (file,) = check_texts([ModelFile("s.rl", ROLES)])
    role = Entity("role", "eyes")
    assert names.description(file, role) == "role eyes\n  provided by watch\n  needed by go"
    assert names.definition(file, role).line == 2
    assert [(one.line, one.column) for one in names.renamed([file], role, "sight")["s.rl"]] == [(2, 26), (3, 20)]


def test_indentation_keeps_comments_and_the_model():
    text = "skillset s {\n/* a\n   b */\nskill f { // why\nsuccess ok\n}\n\n\n\n   }"
    assert formatted(text) == "skillset s {\n  /* a\n   b */\n  skill f { // why\n    success ok\n  }\n\n}\n"
    for path in sorted((MODELS / "uav").glob("*.skill")):
        assert formatted(path.read_text()) == path.read_text()
