"""A mission whose trees lie in a library that its scenario names is repaired as one that includes them."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("z3")
pytest.importorskip("py_trees")

from alula.prove.limits import Deadline
from alula.repair.repairing import Question, Search
from alula.repair.subject import Subject

FILES = {
    "robot.yaml": "name: carrier\n",
    "scenarios/carry.yaml": "about: carries\nmission: missions/carry.xml\nskillsets: [arm]\nlibrary: [../trees]\n",
    "skillsets/arm.skill": "skillset arm {\n  skill grip { result { success DONE  failure SLIPPED } }\n}\n",
    "skillsets/faults.yaml": "faults:\n  grease: {ends: {arm.grip: SLIPPED}}\n",
    "missions/carry.xml": """<root BTCPP_format="4" main_tree_to_execute="carry">
  <BehaviorTree ID="carry">
    <Sequence name="carry it">
      <SubTree ID="take" name="take it"/>
    </Sequence>
  </BehaviorTree>
</root>
""",
    "trees/take.xml": """<root BTCPP_format="4">
  <BehaviorTree ID="take"><arm.grip name="grip"/></BehaviorTree>
</root>
""",
}


@pytest.mark.parametrize("name", ["carry.xml", "changed.xml"])
def test_trees_of_a_library_are_there(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also for a copy of the file that a scenario flies."""
    for file, text in FILES.items():
        (tmp_path / file).parent.mkdir(exist_ok=True)
        (tmp_path / file).write_text(text)
    monkeypatch.setenv("ALULA_ROBOT", str(tmp_path))
    path = tmp_path / "missions" / name
    path.write_text(FILES["missions/carry.xml"])
    answer = Search(Subject.read(path, print), Question("grease"), Deadline.after(600.0), print).run()
    assert answer.repair is not None
    before = '      <SubTree ID="take" name="take it"/>\n'
    after = f"""      <RetryUntilSuccessful name="three chances" num_attempts="3">
  {before}      </RetryUntilSuccessful>
"""
    assert answer.repair.text == FILES["missions/carry.xml"].replace(before, after)
