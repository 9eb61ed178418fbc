"""The trees of a folder in the editor: what is offered, where it is defined, and under which other name."""

from __future__ import annotations

import random
import re
from pathlib import Path

import pytest
from test_editor_server import Editor

from alula.editor.completion import Place
from alula.editor.missions import Missions
from alula.editor.names import RenameError
from alula.editor.tree_names import TreeFolder
from alula.language.models import ModelFile
from alula_testing.waits import HANGS_S

MAIN = """<root BTCPP_format="4" main_tree_to_execute="Main">
  <BehaviorTree ID="Main">
    <Sequence>
      <Find goal="{goal}"/>
      <SubTree ID="Dock" goal="{goal}" place="{=}"/>
      <SubTree ID="Look" _autoremap="true"/>
      <ScriptCondition code="goal == 1 &amp;&amp; goals == 2"/>
    </Sequence>
  </BehaviorTree>
</root>
"""
ON = '_autoremap="true"'
DOCK = """<root BTCPP_format="4">
  <BehaviorTree ID="Dock">
    <Goto goal="{goal}" place="{place}" _skipIf="goal == 3"/>
  </BehaviorTree>
  <BehaviorTree ID="Look">
    <Goto goal="{=}" place="{goal}"/>
  </BehaviorTree>
  <TreeNodesModel>
    <Action ID="Goto"><input_port name="goal"/><input_port name="place"/></Action>
    <Action ID="Find"><output_port name="goal"/></Action>
    <SubTree ID="Dock"><input_port name="goal"/><input_port name="place"/></SubTree>
  </TreeNodesModel>
</root>
"""


@pytest.fixture
def trees(tmp_path):
    (tmp_path / "main.xml").write_text(MAIN)
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts/dock.xml").write_text(DOCK)
    return tmp_path


def read(folder: Path) -> TreeFolder:
    found = TreeFolder.around(folder / "main.xml")
    found.refresh({})
    return found


def at(folder: Path, name: str, before: str, text: str):
    """Return the place, 1-based, behind some text of a file."""
    offset = text.index(before) + len(before)
    return folder / name, text.count("\n", 0, offset) + 1, offset - text.rfind("\n", 0, offset)


def renamed(folder: Path, place: tuple[Path, int, int], name: str) -> dict[str, str]:
    """Return the texts of the files in which a name has another one."""
    found = read(folder)
    asked = found.at(*place)
    assert asked is not None
    texts = {}
    for path, changes in found.renamed(asked, name).items():
        lines = Path(path).read_text().split("\n")
        for span, text in sorted(changes, key=lambda one: (one[0].line, one[0].column), reverse=True):
            line = lines[span.line - 1]
            lines[span.line - 1] = line[: span.column - 1] + text + line[span.end_column - 1 :]
        texts[Path(path).name] = "\n".join(lines)
    return texts


def test_a_tree_is_renamed_in_all_files(trees):
    texts = renamed(trees, at(trees, "main.xml", '<SubTree ID="D', MAIN), "Berth")
    assert texts == {"main.xml": MAIN.replace('"Dock"', '"Berth"'), "dock.xml": DOCK.replace('"Dock"', '"Berth"')}
    texts = renamed(trees, at(trees, "main.xml", 'execute="M', MAIN), "Start")
    assert texts == {"main.xml": MAIN.replace('"Main"', '"Start"')}


def test_an_entry_is_renamed_where_trees_share_it(trees):
    """Main and Look share theirs; Dock has one of its own, which a port gives it."""
    texts = renamed(trees, at(trees, "main.xml", '<Find goal="{g', MAIN), "aim")
    main = (
        MAIN.replace('Find goal="{goal}"', 'Find goal="{aim}"')
        .replace('"Dock" goal="{goal}"', '"Dock" goal="{aim}"')
        .replace("goal ==", "aim ==")
    )
    assert texts == {"main.xml": main, "dock.xml": DOCK.replace('goal="{=}" place="{goal}"', 'goal="{aim}" place="{aim}"')}


def test_an_entry_that_a_port_gives_is_renamed_with_the_port(trees):
    texts = renamed(trees, at(trees, "parts/dock.xml", 'goal="{g', DOCK), "aim")
    dock = DOCK.replace('<Goto goal="{goal}" place="{place}" _skipIf="goal', '<Goto goal="{aim}" place="{place}" _skipIf="aim')
    dock = dock.replace('"Dock"><input_port name="goal"', '"Dock"><input_port name="aim"')
    assert texts == {"main.xml": MAIN.replace('"Dock" goal=', '"Dock" aim='), "dock.xml": dock}
    texts = renamed(trees, at(trees, "parts/dock.xml", 'place="{p', DOCK), "where")
    assert 'where="{place}"' in texts["main.xml"]  # which was {=}: the entry above keeps its name


@pytest.mark.parametrize(
    ("before", "name", "why"),
    [
        ('<SubTree ID="D', "Look", "there is a tree `Look` at "),
        ('<SubTree ID="D', "a/b", "`a/b` is no ID of a tree"),
        ("goal == 1 &amp;&amp; g", "goal", "there is an entry `goal` already at "),
        ('<Find goal="{g', "a b", "`a b` is no name of an entry"),
        ("<F", "Seek", "`Find` is a type of node, which a program registers"),
    ],
)
def test_a_name_that_would_change_the_meaning_is_refused(trees, before, name, why):
    with pytest.raises(RenameError, match=re.escape(why)):
        renamed(trees, at(trees, "main.xml", before, MAIN), name)


def test_trees_and_nodes_lead_to_where_they_are_defined(trees):
    found = read(trees)
    for before, line in (('<SubTree ID="D', 2), ('<SubTree ID="L', 5), ("<F", 10)):
        asked = found.at(*at(trees, "main.xml", before, MAIN))
        span = found.definition(asked)
        assert (Path(span.file).name, span.line) == ("dock.xml", line)
    assert found.at(trees / "main.xml", 1, 2) is None


def offered(folder: Path, before: str) -> set[str]:
    text = MAIN.replace("    </Sequence>", f"      {before}\n    </Sequence>", 1)
    file, line = ModelFile(str(folder / "main.xml"), text), MAIN[: MAIN.index("    </Sequence>")].count("\n") + 1
    return {one.label for one in Missions().completions(file, Place(line, len(before) + 7))}


def test_nodes_ports_and_trees_of_the_folder_are_offered(trees):
    assert {"Goto", "Find", "Sequence"} <= offered(trees, "<")
    assert {"goal", "place"} <= offered(trees, "<Goto ")
    assert {"Main", "Dock", "Look"} == offered(trees, '<SubTree ID="')
    assert {"goal", "place"} <= offered(trees, '<SubTree ID="Dock" ')


def test_a_file_that_is_broken_at_the_moment_keeps_its_names(trees):
    found = read(trees)
    found.refresh({trees / "parts/dock.xml": (1, DOCK.replace("</root>", "<"))})
    assert "Dock" in found.trees
    found.refresh({trees / "parts/dock.xml": (2, DOCK.replace('"Dock"', '"Berth"'))})
    assert ("Dock" in found.trees, "Berth" in found.trees) == (False, True)
    (trees / "parts/dock.xml").unlink()
    found.refresh({})
    assert list(found.trees) == ["Main"]


def test_a_check_knows_the_trees_of_the_folder(trees):
    file = Missions().checked(str(trees / "main.xml"), MAIN)
    assert "ALU617" not in {one.code for one in file.findings}
    (trees / "parts/dock.xml").unlink()
    file = Missions().checked(str(trees / "main.xml"), MAIN)
    assert "ALU617" in {one.code for one in file.findings}


def test_new_names_keep_what_the_trees_do(tmp_path):
    """Random trees that give entries to one another: renamed back, all texts are what they were."""
    chance = random.Random(5)  # noqa: S311 - for tests
    for number in range(40):
        folder = tmp_path / str(number)
        folder.mkdir()
        keys = ["a", "b", "c"]
        for name in ("T0", "T1", "T2"):
            nodes = [f'<X p="{{{chance.choice(keys)}}}" _skipIf="{chance.choice(keys)} == 1"/>' for _ in range(3)]
            for other in [one for one in ("T0", "T1", "T2") if one > name]:
                port = f'{chance.choice(keys)}="{{{chance.choice(keys)}}}"'
                nodes.append(f'<SubTree ID="{other}" {chance.choice([port, "", ON])}/>')
            body = "\n".join(nodes)
            (folder / f"{name}.xml").write_text(
                f'<root BTCPP_format="4"><BehaviorTree ID="{name}"><Sequence>\n{body}\n</Sequence></BehaviorTree></root>'
            )
        before = {path.name: path.read_text() for path in folder.iterdir()}
        place = (folder / "T0.xml", 2, 8)
        for path, text in renamed(folder, place, "z").items():
            (folder / path).write_text(text)
        assert any(path.read_text() != before[path.name] for path in folder.iterdir())
        for path, text in renamed(folder, place, re.search(r'p="{(\w)}"', before["T0.xml"])[1]).items():
            (folder / path).write_text(text)
        assert {path.name: path.read_text() for path in folder.iterdir()} == before


def test_an_editing_session(trees):
    editor = Editor()
    uri, dock = (trees / "main.xml").as_uri(), (trees / "parts/dock.xml").as_uri()
    line = next(number for number, one in enumerate(MAIN.split("\n")) if "Dock" in one)
    place = {"textDocument": {"uri": uri}, "position": {"line": line, "character": MAIN.split("\n")[line].index("Dock") + 1}}
    try:
        editor.ask("initialize", {"processId": None, "rootUri": None, "capabilities": {}})
        editor.send("initialized", {})
        editor.send("textDocument/didOpen", {"textDocument": {"uri": uri, "languageId": "xml", "version": 1, "text": MAIN}})
        assert "ALU617" not in {one["code"] for one in editor.told()["diagnostics"]}
        found = editor.ask("textDocument/definition", place)
        assert (found["uri"], found["range"]["start"]) == (dock, {"line": 1, "character": 20})
        assert len(editor.ask("textDocument/references", {**place, "context": {"includeDeclaration": True}})) == 3
        changes = editor.ask("textDocument/rename", {**place, "newName": "Berth"})["changes"]
        assert {name: len(edits) for name, edits in changes.items()} == {uri: 1, dock: 2}
        refused = editor.answer("textDocument/rename", {**place, "newName": "Look"})
        assert "there is a tree `Look`" in refused["error"]["message"]
        editor.ask("shutdown", None)
        editor.send("exit", None)
        assert editor.process.wait(HANGS_S) == 0
    finally:
        editor.process.kill()
        editor.process.wait(HANGS_S)
