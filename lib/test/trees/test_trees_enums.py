"""Enumerators of other programs: names that scripts may use, in checks and ticks."""

import pytest

from alula.check.findings import findings_of
from alula.cli.check import main as check
from alula.cli.tree import main as tree

TEXT = """<root BTCPP_format="4"><BehaviorTree ID="M">
  <Sequence><ScriptCondition code="role == LEADER"/><Go/></Sequence></BehaviorTree>
  <TreeNodesModel><Action ID="Go"/><SubTree ID="M"><input_port name="role" default="2"/></SubTree></TreeNodesModel></root>"""


def test_a_check_knows_enumerators():
    (told,) = findings_of("m.xml", TEXT.encode(), (), of_others=True)
    assert "`LEADER` is read, and nothing before writes it" in told.message
    assert findings_of("m.xml", TEXT.encode(), (), of_others=True, enums={"LEADER": 0}) == []


def test_a_tick_knows_enumerators(tmp_path, capsys):
    mission, enums, answers = tmp_path / "m.xml", tmp_path / "enums.json", tmp_path / "answers.json"
    mission.write_text(TEXT.replace("role ==", "LEADER =="))
    answers.write_text('{"Go": ["SUCCESS"]}')
    words = [str(mission), "--answers", str(answers), "--ticks", "1"]
    assert tree(words) == 2
    assert "LEADER" in capsys.readouterr().err
    enums.write_text('{"LEADER": 2}')
    assert tree([*words, "--enums", str(enums)]) == 0
    assert capsys.readouterr().out == "tick 1: SUCCESS, start Go\n"
    assert check([str(mission), "--enums", str(enums), "--no-proofs"]) == 0


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("{", "is no JSON: "),
        ("[1]", "is no object; write "),
        ('{"a b": 1}', "'a b' is no name that a script can use"),
        ('{"A": true}', "'A' is true, no number"),
        (None, "can't be read: No such file or directory"),
    ],
)
def test_wrong_files_are_refused(text, told, tmp_path, capsys):
    mission, enums = tmp_path / "m.xml", tmp_path / "enums.json"
    mission.write_text(TEXT)
    if text is not None:
        enums.write_text(text)
    for command in (tree, check):
        assert command([str(mission), "--enums", str(enums)]) == 2
        assert f"{enums}: {told}" in capsys.readouterr().err
