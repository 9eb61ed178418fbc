"""The rover's part of the report, of a drive over mocks."""

from __future__ import annotations

from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

import pytest
from alula import Mission, Outcome, open_run

from rover_robot.report import RoverReport

ROOT = Path(__file__).resolve().parents[1]


def test_a_parcel_that_was_not_delivered_is_told_with_what_failed(tmp_path):
    shut = tmp_path / "shut.yaml"
    shut.write_text("skills: {cargo.open_door: [{when: door == 'workshop', result: SHUT}]}", encoding="utf-8")
    mission = Mission.load("deliver", ROOT, behaviour=[shut]).run(out=tmp_path / "run")
    assert mission.outcome is Outcome.DEGRADED
    summary = open_run(tmp_path / "run", ROOT).report()
    assert summary["problems"] == []
    assert [(one["name"], one["done"]) for one in summary["tasks"]] == [
        ("store-kitchen", True),
        ("kitchen-workshop", False),
        ("workshop-office", False),
    ]
    assert [one["why"].partition(":")[0] for one in summary["tasks"]] == ["", "open_door SHUT", "open_door SHUT"]


class Problems(list):
    """The problems of a report, a sentence each."""

    note = list.append

    @contextmanager
    def survive(self, what):
        try:
            yield
        except Exception as error:  # noqa: BLE001
            self.note(f"{what}: {error}")


@pytest.mark.parametrize(
    ("recorded", "told"), [(True, ["functional.bag is missing: nothing is known of the rover's true path"]), (False, [])]
)
def test_a_bag_is_missed_only_where_one_was_recorded(tmp_path, recorded, told):
    Mission.load("patrol", ROOT).run(out=tmp_path)
    problems = Problems()
    run = SimpleNamespace(
        facts=SimpleNamespace(mock=False, recorded=recorded), folder=tmp_path, problems=problems, history=SimpleNamespace(executions=[])
    )
    found = RoverReport(run).measure(SimpleNamespace(zero_s=0.0))
    assert problems == told
    assert found.values == {"distance_m": None, "collisions": None}
