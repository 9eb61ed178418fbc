"""Nodes that nobody has declared: told once, and guessed from their uses."""

import pytest

from alula.check.findings import findings_of
from alula.cli.palette import main
from alula.trees.guessing import guessed_types
from alula.trees.node_type import Category
from alula.trees.ports import Direction
from alula.trees.reading import read_models, read_text
from alula.trees.standard import standard_registry
from alula.trees.values import ANY, BOOL, DOUBLE, INT, STRING

TEXT = """<root BTCPP_format="4">
  <BehaviorTree ID="Main">
    <Sequence>
      <IsReady/>
      <FindObject name="find" label="cup" pose="{pose}" result_count="{n}"/>
      <Careful limit="2.5"><Grasp pose="{pose}" force="3" gentle="true"/></Careful>
      <Careful limit="3"><Grasp pose="{pose}" force="4" gentle="false" tool="{tool}"/></Careful>
      <Choose><AlwaysSuccess/><AlwaysFailure/></Choose>
      <Condition ID="Seen" object="cup"/>
      <Sleep msec="{pause}"/>
      <Pause msec="{pause}"/>
    </Sequence>
  </BehaviorTree>
</root>
"""
GUESSED = {
    "IsReady": (Category.CONDITION, {}),
    "FindObject": (
        Category.ACTION,
        {"label": (Direction.INPUT, STRING), "pose": (Direction.OUTPUT, ANY), "result_count": (Direction.OUTPUT, ANY)},
    ),
    "Careful": (Category.DECORATOR, {"limit": (Direction.INPUT, DOUBLE)}),
    "Grasp": (
        Category.ACTION,
        {
            "pose": (Direction.INPUT, ANY),
            "force": (Direction.INPUT, INT),
            "gentle": (Direction.INPUT, BOOL),
            "tool": (Direction.INPUT, ANY),
        },
    ),
    "Choose": (Category.CONTROL, {}),
    "Seen": (Category.CONDITION, {"object": (Direction.INPUT, STRING)}),
    "Pause": (Category.ACTION, {"msec": (Direction.INPUT, standard_registry().get("Sleep").ports["msec"].type)}),
}


def test_types_are_guessed_from_uses():
    files = read_text(TEXT)
    found = {one.name: one for one in guessed_types(files.trees.values(), standard_registry())}
    assert {
        name: (one.category, {port.name: (port.direction, port.type) for port in one.ports.values()}) for name, one in found.items()
    } == GUESSED
    assert found["Careful"].doc == "guessed from 2 uses, first <text>:6:7"


def test_a_check_with_the_guess_finds_nothing_unknown(tmp_path, capsys):
    (tmp_path / "main.xml").write_text(TEXT.replace(' ID="Main"', ""))
    assert main([str(tmp_path), "--guess"]) == 0
    out, err = capsys.readouterr()
    assert err == "alula palette: nodes that are guessed from their uses: 7; look at categories, directions and types first\n"
    assert "guessed from 2 uses" in out
    guess = tmp_path / "guess.model"
    guess.write_text(out)
    assert {one.name for one in read_models(guess)} == set(GUESSED)
    (told,) = findings_of("main.xml", TEXT.encode(), (), of_others=True, palettes=[guess])
    assert told.code == "ALU607"  # `tool` and `pause`, which nothing writes
    assert main([str(tmp_path / "main.xml"), str(guess), "--guess"]) == 0
    assert "guessed from their uses: 0;" in capsys.readouterr().err
    assert main([str(guess)]) == 0
    assert capsys.readouterr().out.count("<Decorator ") == 1


def test_undeclared_nodes_of_others_are_told_once_and_slips_one_by_one():
    text = TEXT.replace("<Sleep ", "<Slepp ").replace("<Choose>", "<Sequencee>").replace("</Choose>", "</Sequencee>")
    found = [(one.code, one.severity.value, one.message) for one in findings_of("m.xml", text.encode(), (), of_others=True)]
    assert found[0] == ("ALU601", "warning", "7 nodes are not declared: IsReady, FindObject, Careful, Grasp, Seen, ...")
    assert [one for one in found if one[0] == "ALU601"][1:] == [("ALU601", "error", "unknown node 'Sequencee'")]
    ours = [one.severity.value for one in findings_of("m.xml", TEXT.encode(), ()) if one.code == "ALU601"]
    assert ours == ["error"] * 9


def test_a_program_writes_entries_which_is_told_once():
    text = '<root BTCPP_format="4"><BehaviorTree ID="M"><Sequence><Sleep msec="{a}"/><Sleep msec="{b}"/></Sequence></BehaviorTree></root>'
    (told,) = findings_of("m.xml", text.encode(), (), of_others=True)
    assert told.message.endswith("nothing before writes it, and so it is in 1 more, which is right where the program writes it")
    assert len(findings_of("m.xml", text.encode(), ())) == 2


def test_an_entry_that_is_written_later_may_be_the_programs_before():
    nodes = '<Script code="a := goal"/><Script code="goal := 1"/>'
    text = f'<root BTCPP_format="4"><BehaviorTree ID="M"><Sequence>{nodes}</Sequence></BehaviorTree></root>'.encode()
    for of_others, severity in ((False, "error"), (True, "warning")):
        (told,) = findings_of("m.xml", text, (), of_others=of_others)
        assert (told.code, told.severity.value) == ("ALU607", severity)


def test_a_folder_without_trees_has_nothing_to_guess(tmp_path, capsys):
    assert main([str(tmp_path), "--guess"]) == 2
    assert capsys.readouterr().err == f"alula palette: {tmp_path}: there are no trees in it\n"


@pytest.mark.parametrize(
    ("literals", "type_"),
    [(("1", "2"), INT), (("1", "2.5"), DOUBLE), (("true", "FALSE"), BOOL), (("1", "x"), STRING), (("",), STRING), (("1e3",), DOUBLE)],
)
def test_types_of_literals(literals, type_):
    nodes = "".join(f'<Go to="{one}"/>' for one in literals)
    files = read_text(f'<root BTCPP_format="4"><BehaviorTree ID="M"><Sequence>{nodes}</Sequence></BehaviorTree></root>')
    (found,) = guessed_types(files.trees.values(), standard_registry())
    assert found.ports["to"].type is type_


def test_nodes_of_others_that_are_used_otherwise_than_declared_are_one_warning():
    model = '<TreeNodesModel><Action ID="Go"><input_port name="to"/><output_port name="at"/></Action><Control ID="Say"/></TreeNodesModel>'
    uses = '<Sequence><Go to="3" too="1"/><Go at="here"/><Go to="4" too="1"/>{}</Sequence>'
    text = f'<root BTCPP_format="4"><BehaviorTree ID="M">{uses}</BehaviorTree>{model}</root>'
    (told,) = findings_of("m.xml", text.format("").encode(), (), of_others=True)
    assert (told.code, told.severity.value, told.hint) == ("ALU603", "warning", "did you mean to?")
    assert told.message == "'Go' is used otherwise than it is declared (3 times); here 'Go' has no port 'too'"
    (told,) = findings_of("m.xml", text.format("<Say/>").encode(), (), of_others=True)
    assert told.message == "2 nodes are used otherwise than they are declared: Go, Say; here 'Go' has no port 'too'"
    ours = [(one.code, one.severity.value) for one in findings_of("m.xml", text.format("<Say/>").encode(), ())]
    assert [one for one in ours if one[0] != "ALU620"] == [(f"ALU60{number}", "error") for number in (3, 5, 3, 2)]
