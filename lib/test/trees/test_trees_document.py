"""Files: places, a round trip that keeps all, and nothing in them that harms or hangs."""

from __future__ import annotations

import random
import time

import pytest

from alula.trees.document import DEEPEST, parse_document
from alula.trees.errors import FileError, Problem, TreeError
from alula.trees.factory import make_tree
from alula.trees.reading import read_files, read_text
from alula.trees.standard import standard_registry

GROOT = """\ufeff<?xml version="1.0" encoding="UTF-8"?>
<!-- made by an editor -->
<root BTCPP_format="4"
      main_tree_to_execute='Main' project_name="Project">
  <BehaviorTree ID="Main" editor_version="5">
    <!-- why: the ä counts as one character -->
    <Sequence name="ä &amp; &quot;b&quot;" _fullpath="" _collapsed="true">
      <Script code="x := 1;&#10;y := 'a'" /><AlwaysSuccess  name = 'n'/>
      text &amp; <![CDATA[more < text]]>
    </Sequence >
  </BehaviorTree>
  <!-- Description of Node Models (used by Groot) -->
  <TreeNodesModel>
    <Action ID="Go"><input_port name="to" type="std::string">where</input_port></Action>
  </TreeNodesModel>
</root>
<!-- the end -->
"""


def test_a_file_is_written_as_it_was_read():
    assert parse_document(GROOT).text() == GROOT
    assert parse_document(GROOT.replace("\n", "\r\n")).text() == GROOT.replace("\n", "\r\n")


def test_what_is_changed_is_written_and_read_again():
    document = parse_document(GROOT)
    sequence = document.root.children[0].children[0]
    sequence.set("name", 'c < "d" &\n')
    sequence.set("_uid", "1")
    again = parse_document(document.text())
    assert again.root.children[0].children[0].get("name") == 'c < "d" &\n'
    assert again.text() == document.text()
    assert GROOT.replace('"ä &amp; &quot;b&quot;"', "?") == document.text().replace('"c &lt; &quot;d&quot; &amp;&#10;"', "?").replace(
        ' _uid="1"', ""
    )


def test_places_are_lines_and_characters_of_the_file():
    sequence = parse_document(GROOT, "f.xml").root.children[0].children[0]
    script = sequence.children[0].attributes["code"]
    assert str(sequence.place) == "f.xml:7:5"
    assert str(sequence.place_of("_fullpath")) == "f.xml:7:44"
    assert str(script.place_of(0)) == "f.xml:8:21"
    assert str(script.place_of(8)) == "f.xml:8:33"  # behind &#10;, five characters of the file


LEVELS = "".join(f'<!ENTITY {name} "{f"&{inner};" * 10}">' for inner, name in ("ab", "bc", "cd", "de", "ef", "fg", "gh"))
BOMB = f'<!DOCTYPE a [<!ENTITY a "{"b" * 100}">{LEVELS}'
REFUSED = {
    BOMB + "]><root>&h;</root>": "f.xml:1:13: has a document type (<!DOCTYPE>)",
    "<a>" * 3_400_000: f"f.xml:1:{DEEPEST * 3 + 1}: is nested deeper than 256 levels",
    "<root>" + "<a/>" * 200_000 + "</root>": "has more than 30000 elements",
    "": "f.xml:1:1: is no XML: no element found",
    "<root>\n<a></b></root>": "f.xml:2:6: is no XML: mismatched tag; close <a> of line 2 first, with </a>",
    "<root>\n<a>\n": "f.xml:3:1: is no XML: no element found; close <a> of line 2 first, with </a>",
    "<root a='1' a='2'/>": "duplicate attribute",
    "<root>&nbsp;</root>": "undefined entity",
    "<other/>": "f.xml:1:1: begins with <other>",
}


@pytest.mark.parametrize(("text", "message"), REFUSED.items(), ids=[str(number) for number in range(len(REFUSED))])
def test_what_is_no_file_of_trees_is_refused_at_its_place(text, message):
    begun = time.process_time()
    with pytest.raises(FileError) as error:
        read_text(text, "f.xml")
    assert message in str(error.value)
    assert "\n" not in str(error.value)
    assert time.process_time() - begun < 60  # far below what a bomb takes


def test_bytes_that_are_no_text_are_refused(tmp_path):
    path = tmp_path / "f.xml"
    path.write_bytes(b"<root>\n<a b='\xe4'/></root>")
    with pytest.raises(FileError, match=r"f.xml:2:7: is not UTF-8; save it as UTF-8"):
        read_files(path)
    with pytest.raises(FileError, match="can't be read: No such file"):
        read_files(tmp_path / "other.xml")
    with pytest.raises(FileError, match="can't be read: Is a directory"):
        read_files(tmp_path)


def test_includes_are_read_once_and_from_their_own_folder(tmp_path):
    (tmp_path / "parts").mkdir()
    main = '<root BTCPP_format="4" main_tree_to_execute="Main"><include path="parts/a.xml"/><include path="parts/b.xml"/>'
    (tmp_path / "main.xml").write_text(main + '<BehaviorTree ID="Main"><SubTree ID="A"/></BehaviorTree></root>')
    part = '<root BTCPP_format="4"><include path="{0}.xml"/><BehaviorTree ID="{1}"><AlwaysSuccess/></BehaviorTree></root>'
    (tmp_path / "parts/a.xml").write_text(part.format("b", "A"))
    (tmp_path / "parts/b.xml").write_text('<root BTCPP_format="4"><BehaviorTree ID="B"><AlwaysSuccess/></BehaviorTree></root>')
    files = read_files(tmp_path / "main.xml")
    assert (list(files.trees), len(files.documents), files.main) == (["B", "A", "Main"], 3, "Main")
    (tmp_path / "parts/b.xml").write_text(part.format("a", "B"))
    with pytest.raises(FileError, match=r"b.xml:1:24: a.xml includes itself"):
        read_files(tmp_path / "main.xml")
    (tmp_path / "parts/b.xml").write_text(part.format("c", "B"))
    with pytest.raises(FileError, match=r"b.xml:1:33: there is no file .*parts/c.xml"):
        read_files(tmp_path / "main.xml")


def test_a_checker_gets_all_that_is_wrong():
    problems: list[Problem] = []
    read_text('<root BTCPP_format="5"><include/><BehaviorTree/><BehaviorTree ID="a"/></root>', "f.xml", problems.append)
    assert [str(problem) for problem in problems] == [
        "f.xml:1:7: is of BehaviorTree.CPP 5; format 4 is read",
        'f.xml:1:24: <include> has no path; write <include path="other.xml"/>',
        "f.xml:1:34: <BehaviorTree> has no ID; name it: the file has several",
        "f.xml:1:34: the tree '' has 0 nodes at its top; it needs one",
        "f.xml:1:49: the tree 'a' has 0 nodes at its top; it needs one",
        "f.xml:1:1: has several trees, and does not say which is the main one; "
        'add main_tree_to_execute="...", or choose with `--main`: BehaviorTree_0, a',
    ]


def test_a_file_with_anything_changed_is_read_or_refused_in_one_line():
    """1,000 files with characters and tags replaced, doubled, or gone: a good line or a tree, never another error."""
    rng = random.Random(4)  # noqa: S311
    source = GROOT.replace("<AlwaysSuccess", '<Repeat num_cycles="2"><AlwaysSuccess').replace("'n'/>", "'n'/></Repeat>").lstrip("\ufeff")
    pieces = ["<", ">", '"', "/", "&", "{", "}", "<Sequence>", "</Sequence>", "<SubTree ID='Main'/>", "\0", "ü", " _while='", "{=}", "ID="]
    read = 0
    for _ in range(1000):
        text = source
        for _ in range(rng.randint(1, 3)):
            at, length = rng.randrange(len(text)), rng.choice([0, 1, 1, 5, 30])
            text = text[:at] + rng.choice([*pieces, "", text[at : at + 20]]) + text[at + length :]
        try:
            make_tree(read_text(text), standard_registry(), lambda: 0).tick()
            read += 1
        except TreeError as error:
            assert "\n" not in str(error), text  # noqa: PT017 - either is right
    assert read > 50


@pytest.mark.parametrize(
    ("written", "value"),
    [
        ("a<1 && b == 'c'", "a<1 && b == 'c'"),
        ("a &lt; 1 && b", "a < 1 && b"),
        ("a & b &amp; &#99;", "a & b & c"),
        ("x<y", "x<y"),
        ("a &&\n  b;", "a &&   b;"),
        ("1 &ltx", "1 &ltx"),
    ],
)
def test_ampersands_and_less_than_in_scripts_are_read_as_the_fields_reader_reads_them(written, value):
    text = f'<root><!-- a < b & "c --><A b="{written}" c="&lt;"/> x & y\n<B   d = "1"/></root>'
    document = parse_document(text, "m.xml")
    node, other = document.root.children
    assert (node.get("b"), node.get("c")) == (value, "<")
    assert (other.tag, other.place.line, other.place.column) == ("B", 2 + written.count("\n"), 1)
    assert document.text() == text
    assert node.attributes["b"].place_of(2).column == text.index(written) + 3


NO_XML = ('<root a="1 b="2"/>', "<root><</root>", "<root><A b=<c>/></root>", "<root>&nothing;</root>", "<root><!-- & ", '<root a&b="1"/>')


@pytest.mark.parametrize("text", NO_XML)
def test_what_no_reader_takes_is_still_no_xml(text):
    with pytest.raises(FileError, match="is no XML"):
        parse_document(text, "m.xml")


SLIPS = (
    ("<!-------><root/>", 1, 5, "comment"),
    ("<root><!-- a -- b --></root>", 1, 14, "comment"),
    ("<root><!--> --></root>", 0, 0, ""),
    ('\n \n<?xml version="1.0"?>\n<root/>', 3, 1, "<?xml"),
    ('<root><a b="1 && 2 && 3"/></root>', 1, 15, "&"),
    ('<root><a b="1 < 2"/></root>', 1, 15, "<"),
)


@pytest.mark.parametrize(("text", "line", "column", "what"), SLIPS)
def test_what_is_no_xml_and_is_read_all_the_same_is_a_warning_with_its_place(text, line, column, what):
    document = parse_document(text)
    assert document.text() == text
    assert document.root.tag == "root"
    assert [(slip.place.line, slip.place.column, slip.warning) for slip in document.slips] == ([(line, column, True)] if line else [])
    assert all(what in slip.message and slip.cure for slip in document.slips)


def test_what_an_editor_keeps_among_the_models_is_left_to_it():
    """Elements that are no category of nodes, and such inside a model, as MoveIt Pro writes them."""
    more = '<MetadataFields><Metadata subcategory="x"/></MetadataFields>'
    text = GROOT.replace("<TreeNodesModel>", f"<TreeNodesModel>{more}").replace("</Action>", f"{more}</Action>")
    assert list(read_text(text).declared().get("Go").ports) == ["to"]


@pytest.mark.parametrize("model", ["<TreeNodesModel/><TreeNodesModel/>", "<TreeNodesModel><SubTree/></TreeNodesModel>"])
def test_models_that_the_field_refuses_are_refused(model):
    behaviortreepy = pytest.importorskip("behaviortreepy")
    text = f'<root BTCPP_format="4"><BehaviorTree ID="m"><AlwaysSuccess/></BehaviorTree>{model}</root>'
    with pytest.raises((RuntimeError, ValueError)):
        behaviortreepy.BehaviorTreeFactory().create_tree_from_text(text)
    with pytest.raises(FileError):
        read_text(text)


WHOLE = ("1", "-1", "1 ", "1\t", " 1", " 1 ", "+1", "0", "4294967295", "4294967296", "\u0661", "")
LISTS = ("1;2", "1;2;", "1 ;2", "1; 2", " 1;2", "1;;2", "")


def loads(node):
    """Return whether BehaviorTree.CPP makes a tree of a node, and whether this library does."""
    behaviortreepy = pytest.importorskip("behaviortreepy")
    text = f'<root BTCPP_format="4"><BehaviorTree ID="m">{node}</BehaviorTree></root>'
    answers = []
    for make in (
        lambda: behaviortreepy.BehaviorTreeFactory().create_tree_from_text(text),
        lambda: make_tree(read_text(text), standard_registry(), lambda: 0),
    ):
        try:
            make()
        except (RuntimeError, ValueError, TreeError):
            answers.append(False)
        else:
            answers.append(True)
    return answers


@pytest.mark.parametrize("value", WHOLE)
@pytest.mark.parametrize("node", ['<Sleep msec="{}"/>', '<Repeat num_cycles="{}"><AlwaysSuccess/></Repeat>'])
def test_whole_numbers_are_read_as_the_field_reads_them(node, value):
    theirs, ours = loads(node.format(value))
    assert ours == theirs


@pytest.mark.parametrize("value", LISTS)
@pytest.mark.parametrize("item", ["Int", "String"])
def test_lists_are_read_as_the_field_reads_them(item, value):
    theirs, ours = loads(f'<Loop{item} queue="{value}" value="{{x}}"><AlwaysSuccess/></Loop{item}>')
    assert ours == theirs


def test_a_project_reads_what_it_includes_and_needs_no_main_tree(tmp_path):
    for name in ("one", "other"):
        (tmp_path / f"{name}.xml").write_text(f'<root BTCPP_format="4"><BehaviorTree ID="{name}"><AlwaysSuccess/></BehaviorTree></root>')
    project = tmp_path / "all.btproj"
    project.write_text('<root BTCPP_format="4" project_name="all"><include path="one.xml"/><include path="other.xml"/></root>')
    assert list(read_files(project).trees) == ["one", "other"]


def test_ids_of_trees_that_newer_versions_refuse_are_one_warning():
    trees = "".join(f'<BehaviorTree ID="{name}"><AlwaysSuccess/></BehaviorTree>' for name in ("a b", "c.d", "\u00e9_1-x"))
    problems: list[Problem] = []
    read_text(f'<root BTCPP_format="4" main_tree_to_execute="a b">{trees}</root>', report=problems.append)
    (problem,) = problems
    assert (problem.code, problem.warning, problem.place.column) == ("ALU621", True, 65)
    assert "'a b', and 1 more IDs of trees, have" in problem.message
