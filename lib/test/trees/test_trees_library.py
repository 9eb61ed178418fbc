"""Folders of trees: what files use of one another without including it."""

import json
from pathlib import Path

import pytest

from alula.api.checking import checked_files
from alula.cli.tree import main
from alula.common.robots import meaning
from alula.trees.errors import FileError, Problem
from alula.trees.factory import make_tree
from alula.trees.library import Library, ignore
from alula.trees.reading import read_files
from alula.trees.standard import standard_registry

FILE = '<root BTCPP_format="4">{}</root>'
TREE = '<BehaviorTree ID="{}">{}</BehaviorTree>'


def tree(name: str, *uses: str) -> str:
    inner = "".join(f'<SubTree ID="{use}"/>' for use in uses) or "<AlwaysSuccess/>"
    return TREE.format(name, f"<Sequence>{inner}</Sequence>")


def write(folder: Path, **files: str) -> Library:
    for name, trees in files.items():
        path = folder / f"{name.replace('__', '/')}.xml"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(FILE.format(trees))
    library = Library()
    library.add([folder])
    return library


def test_a_file_uses_trees_of_other_files(tmp_path):
    library = write(tmp_path, main=tree("Main", "Dock"), parts__dock=tree("Dock", "Turn"), parts__turn=tree("Turn"), rest=tree("Other"))
    (tmp_path / "package.xml").write_text("<package><name>robot</name></package>")
    files = read_files(tmp_path / "main.xml", library=library)
    assert (list(files.trees), files.main, files.is_part) == (["Main", "Dock", "Turn"], "Main", False)
    assert read_files(tmp_path / "parts/dock.xml", library=library).is_part
    with pytest.raises(FileError, match="there is no tree 'Dock'"):
        make_tree(read_files(tmp_path / "main.xml"), standard_registry(), lambda: 0)


def test_a_files_own_tree_comes_first_then_the_nearest_one(tmp_path):
    library = write(
        tmp_path,
        one__main=tree("Main", "Dock"),
        one__dock=tree("Dock"),
        two__dock=tree("Dock", "Turn"),
        own=tree("Own", "Dock") + tree("Dock"),
    )
    problems: list[Problem] = []
    files = read_files(tmp_path / "one/main.xml", problems.append, library=library)
    assert files.trees["Dock"].place.path == str(tmp_path / "one/dock.xml")
    (told,) = problems
    assert (told.code, told.warning) == ("ALU622", True)
    assert told.message == f"the tree 'Dock' stands in {tmp_path}/own.xml:1:103, too, and in 1 more"
    assert told.place.path == str(tmp_path / "one/dock.xml")
    assert read_files(tmp_path / "own.xml", ignore, library=library).trees["Dock"].place.path == str(tmp_path / "own.xml")


def test_two_trees_of_a_name_that_nobody_uses_are_no_finding(tmp_path):
    library = write(tmp_path, one=tree("MainTree"), two=tree("MainTree"))
    assert read_files(tmp_path / "one.xml", library=library).main == "MainTree"


def test_a_mission_names_its_library(tmp_path):
    write(tmp_path, trees__dock=tree("Dock"))
    mission = tmp_path / "main.xml"
    mission.write_text(FILE.format(tree("Main", "Dock")).replace("<root", '<root library="trees"'))
    assert list(read_files(mission).trees) == ["Main", "Dock"]
    mission.write_text(mission.read_text().replace("trees", "treees"))
    with pytest.raises(FileError, match=r"main.xml:1:7: there is no folder .*/treees; the path counts from this file on"):
        read_files(mission)


def test_includes_find_ros_packages(tmp_path, monkeypatch):
    including = '<include ros_pkg="{}" path="trees/dock.xml"/>' + tree("Main", "Dock")
    write(tmp_path, ws__mine__trees__dock=tree("Dock"), ws__mine__main=including.format("mine"), other=including.format("mine"))
    (tmp_path / "ws/mine/package.xml").write_text("<package><name> mine </name></package>")
    inside, outside = tmp_path / "ws/mine/main.xml", tmp_path / "other.xml"
    assert list(read_files(inside).trees) == ["Dock", "Main"]
    with pytest.raises(FileError, match="there is no ROS package 'mine'; name its folder: `--package mine=DIR`"):
        read_files(outside)
    assert list(read_files(outside, library=Library({"mine": tmp_path / "ws/mine"})).trees) == ["Dock", "Main"]
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path / "ws"))
    assert list(read_files(outside).trees) == ["Dock", "Main"]
    monkeypatch.delenv("ROS_PACKAGE_PATH")
    (tmp_path / "prefix/share").mkdir(parents=True)
    (tmp_path / "ws/mine").rename(tmp_path / "prefix/share/mine")
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path / "prefix"))
    assert list(read_files(outside).trees) == ["Dock", "Main"]


def test_a_folder_is_drawn_tree_by_tree(tmp_path, capsys):
    write(tmp_path, main=tree("Main", "Dock") + tree("Again"), dock=tree("Dock"))
    assert main([str(tmp_path)]) == 0
    assert [line for line in capsys.readouterr().out.splitlines() if line.endswith(("Main", "Again", "Dock"))] == [
        "main.xml: Main",
        "└─ ↳ Dock",
        "main.xml: Again",
    ]
    assert main([str(tmp_path), "--main", "Dock"]) == 0
    assert capsys.readouterr().out.startswith("dock.xml: Dock\n")
    assert main([str(tmp_path), "--main", "Dok"]) == 2
    assert "no file in this folder has a tree 'Dok'; did you mean Dock?" in capsys.readouterr().err
    assert main([str(tmp_path), "--svg", str(tmp_path / "x.svg")]) == 2
    assert "--svg: is of one tree; choose it with `--main`: Main, Again" in capsys.readouterr().err
    assert main([str(tmp_path / "main.xml"), str(tmp_path), "--main", "Main"]) == 0


def test_a_file_that_is_wrong_keeps_no_other_of_the_folder_from_being_drawn(tmp_path, capsys):
    write(tmp_path, a=TREE.format("A", '<Sleep mse="1"/>'), b=TREE.format("B", ""), c=tree("C"))
    (tmp_path / "d.xml").write_text("<root><BehaviorTree></root>")
    assert main([str(tmp_path)]) == 2
    out, err = capsys.readouterr()
    assert out.startswith("c.xml: C\n")
    assert sorted(line.partition(".xml")[0][-1] for line in err.splitlines()) == ["a", "b", "d"]


def test_a_tree_that_is_in_no_file_is_drawn_and_ticked_as_a_leaf(tmp_path, capsys):
    write(tmp_path, main=tree("Main", "Dock", "Undock", "Charge"), dock=tree("Dock"))
    (tmp_path / "main.xml").write_text((tmp_path / "main.xml").read_text().replace('ID="Charge"', 'ID="Charge" level="{power}"'))
    assert main([str(tmp_path)]) == 0
    out, err = capsys.readouterr()
    assert out.count("(in none of the files)") == 2
    assert err.endswith("main.xml:1:78: trees that are in none of the files are drawn as leaves: Undock, Charge\n")
    answers = tmp_path / "answers.json"
    charge = ["RUNNING", {"answer": "SUCCESS", "outputs": {"level": 3}}]
    answers.write_text(json.dumps({"answers": {"Undock": ["SUCCESS"], "Charge": charge}}))
    assert main([str(tmp_path), "--answers", str(answers), "--ticks", "2", "--json", "--trace"]) == 0
    last = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert (last["root"], last["calls"], last["written"]) == ("SUCCESS", [["tick", "Charge"]], {"power": 3})
    (tmp_path / "main.xml").write_text(FILE.format(tree("Main", "Undockk") + tree("Undock")))
    assert main([str(tmp_path / "main.xml"), "--main", "Main"]) == 2
    assert "there is no tree 'Undockk'; did you mean Undock?" in capsys.readouterr().err


def test_a_folder_without_trees_and_a_package_without_folder_are_refused(tmp_path, capsys):
    assert main([str(tmp_path)]) == 2
    assert capsys.readouterr().err == f"alula tree: {tmp_path}: there is no file of trees in this folder\n"
    with pytest.raises(SystemExit, match="2"):
        main([str(tmp_path), "--package", "a=nowhere"])
    assert "a=nowhere is no NAME=DIR with a folder that is there" in capsys.readouterr().err


def test_a_folder_is_checked_file_by_file_each_thing_once(tmp_path):
    write(tmp_path, main=tree("Main", "Dock", "Gone"), other=tree("Other", "Dock"), dock=TREE.format("Dock", "<Inverter/>"))
    with meaning(None):
        files = checked_files([str(tmp_path)])
    found = {Path(file.path).name: [one.code for one in file.findings] for file in files}
    assert found == {"dock.xml": ["ALU602"], "main.xml": ["ALU617"], "other.xml": []}


def test_trees_that_are_in_no_file_are_one_finding_of_each_file_that_uses_them(tmp_path):
    write(tmp_path, main=tree("Main", "DockNow", "Gone", "Away", "DockNoww"), dock=tree("DockNow", "Far", "Off", "Far"))
    with meaning(None):
        files = checked_files([str(tmp_path)])
    found = {Path(file.path).name: sorted(one.message for one in file.findings) for file in files}
    assert found == {
        "main.xml": ["2 trees are in none of the files: Gone, Away", "there is no tree 'DockNoww'"],
        "dock.xml": ["2 trees are in none of the files: Far, Off"],
    }


def test_a_tree_that_others_use_is_told_of_by_them_and_one_that_they_do_not_take_by_itself(tmp_path):
    part = TREE.format("Dock", "<Fallback><AlwaysSuccess/><AlwaysFailure/></Fallback>")
    write(tmp_path, main=tree("Main", "Dock"), again=tree("Again", "Dock"), dock=part, backup__old__dock=part)
    with meaning(None):
        files = checked_files([str(tmp_path)])
    found = {str(Path(file.path).relative_to(tmp_path)): [one.code for one in file.findings] for file in files}
    assert found == {"main.xml": [], "again.xml": [], "dock.xml": ["ALU610"], "backup/old/dock.xml": ["ALU622", "ALU610"]}


def test_a_broken_file_of_a_folder_keeps_no_other_from_being_checked(tmp_path):
    write(tmp_path, main=tree("Main", "Dock"), dock=tree("Dock"))
    (tmp_path / "bad.xml").write_text("<root><BehaviorTree></root>")
    files = {Path(file.path).name: [one.code for one in file.findings] for file in checked_files([str(tmp_path)])}
    assert files == {"bad.xml": ["ALU004"], "dock.xml": [], "main.xml": []}
