"""Resources that nothing names are left out of the search, and of nothing else."""

from __future__ import annotations

from pathlib import Path

import pytest

from alula.language.load import parse_skillset
from alula.missions.mission_file import MissionFile
from alula.missions.part import NO_PART
from alula.prove.mission.asked import with_asked_resources
from alula.prove.mission.prover import prove_mission
from alula.trees.reading import read_text
from alula.trees.source import TreeSource

FREE = "".join(f" resource r{number} {{ initial A extern A -> B extern B -> A }}" for number in range(40))
RESOURCES = """
  resource door { initial SHUT extern SHUT -> OPEN extern OPEN -> SHUT }
  resource light { initial OFF extern OFF -> LIT extern LIT -> OFF }
  resource arm { initial FREE FREE -> USED USED -> FREE }
  resource idle { initial OFF extern OFF -> LIT }
"""
MODEL = f"""skillset s {{{RESOURCES}
  skill go {{ provides light achieves resource = (door == OPEN)
    effect {{ take: arm -> USED give: arm -> FREE }} precondition {{ success take }} result {{ success DONE: apply = give }} }}
}}"""


def kept(tree: str, faults: dict[str, frozenset[str]] | None = None) -> list[str]:
    text = f'<root BTCPP_format="4"><BehaviorTree ID="m"><Sequence>{tree}<s.go/></Sequence></BehaviorTree></root>'
    file = MissionFile(TreeSource(Path("mission.xml")), read_text(text), (parse_skillset(MODEL),), NO_PART)
    (model,) = with_asked_resources(file, faults or {})
    return [one.name for one in model.resources]


@pytest.mark.parametrize(
    ("tree", "names"),
    [
        ("", ["arm"]),
        ('<s.door state="OPEN"/>', ["door", "arm"]),
        ('<Condition ID="s.door" state="OPEN"/>', ["door", "arm"]),
        ('<AlwaysSuccess _skipIf="s.door == OPEN || s.light != LIT"/>', ["door", "light", "arm"]),
        ("<Script code=\"why := reason('s.door')\"/>", ["door", "arm"]),
        ('<Script code="lit := LIT"/>', ["light", "arm"]),
        ('<Script code="{given}"/>', ["door", "light", "arm", "idle"]),
    ],
)
def test_what_the_tree_or_the_model_names_is_kept(tree, names):
    assert kept(tree) == names


def test_what_shows_a_fault_that_the_tree_names_is_kept():
    faults = {"dark": frozenset({"s.light OFF"}), "other": frozenset({"s.door OPEN"})}
    wanted = '<AlwaysSuccess _description="property answered: fault dark leads to outcome accomplished;"/>'
    assert kept(wanted, faults) == ["light", "arm"]
    assert kept(wanted, {"dark": frozenset({"s.* OFF"})}) == ["door", "light", "arm", "idle"]
    assert kept("", faults) == ["arm"]


def test_a_mission_is_proved_beside_forty_resources_that_nothing_asks_for(tmp_path: Path):
    """Which are 2^40 situations: the search ends, with the findings that it has without them."""
    path = tmp_path / "mission.xml"
    path.write_text('<root BTCPP_format="4"><BehaviorTree ID="m"><s.go/></BehaviorTree></root>')
    with_them, without = (
        parse_skillset(f"skillset s {{{free} skill go {{ result {{ success DONE failure LOST }} }} }}") for free in (FREE, "")
    )
    proved = [prove_mission(MissionFile.read(path, [model], NO_PART), timeout_s=1e6) for model in (with_them, without)]
    assert all(one.complete for one in proved)
    assert [[one.code for one in each.findings] for each in proved] == [["ALU702"], ["ALU702"]]
