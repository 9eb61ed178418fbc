"""How long a mission took: from a robot's departure, or by the mission's own account where a robot has none."""

from __future__ import annotations

from pathlib import Path

import pytest

from alula.report.history import History
from alula.report.observed import Observed
from alula.report.phases import Phases
from alula.report.summary import duration_s

MISSION = {"start_s": 12.0, "end_s": 15.5}


@pytest.fixture
def robot(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "robot.yaml").write_text("name: arm\n")
    monkeypatch.setenv("ALULA_ROBOT", str(tmp_path))
    return tmp_path


@pytest.mark.usefixtures("robot")
def test_a_robot_without_a_state_of_departure_works_from_the_missions_start_to_its_end() -> None:
    assert duration_s(History(mission=MISSION, first_s=3.0, last_s=40.0), Observed(), Phases(zero_s=3.0)) == 3.5


@pytest.mark.usefixtures("robot")
@pytest.mark.parametrize("lost", ["start_s", "end_s"])
def test_a_mission_that_did_not_begin_or_has_lost_its_account_took_no_known_time(lost: str) -> None:
    assert duration_s(History(mission={**MISSION, lost: None}), Observed(), Phases()) is None


def test_a_robot_that_has_one_and_never_left_it_took_no_known_time() -> None:
    assert duration_s(History(mission=MISSION), Observed(), Phases()) is None


def test_a_robot_that_left_is_away_until_it_is_back_or_to_the_end_of_the_record() -> None:
    away = Phases(zero_s=14.0, departed=True)
    assert duration_s(History(mission=MISSION, last_s=40.0), Observed(), away) == 26.0
    assert duration_s(History(mission=MISSION, last_s=40.0), Observed(), Phases(zero_s=14.0, departed=True, back_s=20.0)) == 6.0
