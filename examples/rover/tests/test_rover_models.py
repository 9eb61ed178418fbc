from __future__ import annotations

from pathlib import Path

import pytest
from alula import Severity, check_files

ROOT = Path(__file__).resolve().parents[1]
BASE = (ROOT / "skillsets/base.skill").read_text(encoding="utf-8")


def test_models_and_missions_have_no_findings():
    files = [*ROOT.glob("skillsets/*.skill"), *ROOT.glob("skillsets/*.rl"), ROOT / "missions/deliver.xml", ROOT / "missions/patrol.xml"]
    assert [str(one) for one in check_files(*files, robot=ROOT) if one.severity is not Severity.NOTE] == []


@pytest.mark.parametrize(
    ("invariant", "property_"),
    [
        ("keeps_pose: resource = (pose_status == GOOD) violation = release", "never_lost_at_speed"),
        ("keeps_authority: resource = (authority == MISSION) violation = release", "never_against_the_operator"),
        ("keeps_link: resource = (link == UP) violation = release", "never_unsupervised"),
    ],
)
def test_a_property_fails_without_its_invariant(invariant, property_, tmp_path):
    changed = tmp_path / "base.skill"
    changed.write_text(BASE.replace(invariant, ""), encoding="utf-8")
    failed = [one for one in check_files(changed) if one.severity is Severity.ERROR]
    assert [one.counterexample.steps != () for one in failed if property_ in one.message] == [True]
