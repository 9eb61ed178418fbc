"""A robot's file of faults: read, and held against its models; what is wrong is told with file and line."""

from __future__ import annotations

import os
from pathlib import Path
from textwrap import dedent

import pytest

from alula.campaign.coverage import processes
from alula.campaign.mocked_scenarios import load_mocked_scenario
from alula.common.scenarios import load_scenario, mission_names
from alula.records.causes.effects import FaultEffects
from alula.records.causes.fault_file import effects_of_robot, load_effects
from alula.records.errors import AnalysisError
from alula.records.models import models_of

ALULA_ROOT = Path(os.environ["ALULA_ROOT"])
DRONE = models_of(["navigation", "perception", "mapping", "video"])


def read(folder: Path, text: str) -> dict[str, FaultEffects]:
    path = folder / "faults.yaml"
    path.write_text(text, encoding="utf-8")
    return dict(load_effects(path, DRONE).known)


def test_states_and_ends_are_read_with_patterns(tmp_path):
    text = """
    faults:
      zed: &zed
        states: {perception.zed_status: [BROKEN, UNKNOWN]}
        ends: {perception.zed_depthmap: LOST, "navigation.*": "*"}
    processes:
      zed_depth: *zed
      radio_link: {later: {navigation.SDK_authority: UNAVAILABLE}}
    """
    known = read(tmp_path, text)
    states = frozenset({"perception.zed_status BROKEN", "perception.zed_status UNKNOWN"})
    assert known["zed"] == FaultEffects(states, frozenset(), frozenset({"perception.zed_depthmap LOST", "navigation.* *"}))
    assert known["zed_depth"] == known["zed"]
    assert known["radio_link"] == FaultEffects(later=frozenset({"navigation.SDK_authority UNAVAILABLE"}))
    assert read(tmp_path, "") == {}


def test_the_example_of_the_page_is_right(tmp_path):
    page = (ALULA_ROOT / "docs/reference/records.md").read_text(encoding="utf-8")
    example = "    faults:\n" + page.partition("\n    faults:\n")[2].partition("\n\n")[0]
    assert read(tmp_path, dedent(example)).keys() == {"lidar", "radio", "uav_guidance"}


@pytest.mark.parametrize(
    ("text", "line", "complaint"),
    [
        ("fault: {}", 1, "a file of faults has no `fault`; it may have faults, processes, transitions, skills (did you mean `faults`?)"),
        (
            "faults:\n  zed: {state: {}}",
            2,
            "`zed` has no `state`; it may have states, later, ends, told, happens, lasts, source (did you mean `states`?)",
        ),
        ("faults:\n  zed:\n    states: {perception.zed_statu: BROKEN}", 3, "there is no resource `perception.zed_statu`; there are"),
        (
            "faults:\n  zed:\n    states: {perception.zed_status: [OK,\n      BROKE]}",
            4,
            "perception.zed_status has no state `BROKE`; it has",
        ),
        ("faults:\n  zed:\n    ends: {perception.zed_depth: LOST}", 3, "there is no skill `perception.zed_depth`; there are"),
        ("faults:\n  zed:\n    ends: {perception.zed_depthmap: LOS}", 3, "perception.zed_depthmap has no end `LOS`; it has"),
        ("faults:\n  zed:\n    ends: [LOST]", 3, "skills should be a mapping"),
        ("faults: {zed: {}}\nprocesses:\n  zed: {}", 3, "`zed` is a fault already; a process needs another name"),
    ],
)
def test_what_is_wrong_is_told_with_file_and_line(text, line, complaint, tmp_path):
    with pytest.raises(AnalysisError) as caught:
        read(tmp_path, text)
    assert str(caught.value).startswith(f"{tmp_path / 'faults.yaml'}:{line}: {complaint}")


def test_the_drones_file_is_right_and_names_what_there_is():
    known = effects_of_robot().known
    scenarios = [load_scenario(name) for name in mission_names()]
    faults = {what for scenario in scenarios for what, _ in scenario.faults}
    faults |= {name.partition(":")[0] for scenario in scenarios for name in load_mocked_scenario(scenario.name).behaviour.faults}
    assert known.keys() - faults - set(processes(scenarios)) == {"master"}
    own = {skillset for scenario in scenarios for skillset in scenario.skillsets} | {"mission"}  # whose end needs no entry
    assert faults - own <= known.keys()
