"""An operator in a campaign over mocks: a pause holds the mission and lets it go on, an abort ends it, each at its time."""

from __future__ import annotations

import pytest

from alula.campaign.coverage import is_troubled
from alula.campaign.mocked_scenarios import load_mocked_scenario
from alula.campaign.plan import MOCKS, PlannedRun
from alula.campaign.rows import OBEYED, rows_of
from alula.common.faults import FaultError, parse_faults
from alula.common.operator import Act, acts_of
from alula.records.errors import AnalysisError


def row_of(*faults: str):
    (row,) = rows_of([PlannedRun(0, "mapping", 0, faults)], MOCKS, (), "")
    return row


def test_acts_are_in_the_order_of_time():
    requests = parse_faults("operator:abort@30, zed@3, operator:pause@10-12.5, operator")
    assert acts_of(requests) == [Act(0.0, "pause"), Act(10.0, "pause"), Act(12.5, "resume"), Act(30.0, "abort")]


def test_nothing_new_is_started_in_a_pause_and_the_mission_is_accomplished_later():
    whole, paused = row_of(), row_of("operator:pause@10-60")
    assert (paused["outcome"], is_troubled(paused)) == ("accomplished", False)
    # A mock's leg of 18 s goes on to its end; the next one is started after the pause.
    assert 30.0 < paused["duration_s"] - whole["duration_s"] < 50.0
    (act,) = [one for one in paused["failures"] if one["kind"] == "fault"]
    assert (act["name"], act["at_s"], act["answered_by"]) == ("operator:pause, ends again", 10.0, OBEYED)


def test_an_abort_ends_the_mission_with_the_robot_at_rest():
    row = row_of("operator:abort@12")
    assert (row["outcome"], row["reason"].split(";")[0], row["landed"], row["open"]) == ("aborted", "aborted by the operator", True, [])
    assert row["duration_s"] < row_of()["duration_s"] - 10.0


def test_an_act_after_the_end_does_nothing():
    row, whole = row_of("operator:abort@3000"), row_of()
    assert (row["outcome"], row["failures"]) == (whole["outcome"], whole["failures"])


def test_what_an_operator_does_not_do_is_refused():
    with pytest.raises(FaultError, match="operator can't be 'dance'; choose one of pause, abort"):
        acts_of(parse_faults("operator:dance@3"))
    with pytest.raises(AnalysisError, match="operator can't be 'dance'"):
        load_mocked_scenario("mapping").check(PlannedRun(0, "mapping", 0, ("operator:dance@3",)).requests)


def test_the_mocks_know_a_stick_that_is_moved_from_a_pilot_who_takes_over_or_lands():
    outcomes = {way: row_of(f"pilot:{way}@10-13") for way in ("stick", "takes")} | {"lands": row_of("pilot:lands@10")}
    assert {way: row["outcome"] for way, row in outcomes.items()} == {"stick": "accomplished", "takes": "given_up", "lands": "given_up"}
    assert outcomes["lands"]["landed"] is True


def test_managers_that_are_killed_over_mocks_are_answered_as_in_flight():
    row = row_of("mapping:killed@9")
    assert (row["outcome"], row["landed"], is_troubled(row)) == ("given_up", True, False)
    assert row["reason"].startswith("mapping.lidar_mapping: FAILED (the managers of mapping have gone")
    (killed,) = [one for one in row["failures"] if one["kind"] == "fault"]
    assert (killed["name"], killed["at_s"]) == ("mapping:killed", 9.0)
    with pytest.raises(AnalysisError, match="there is no fault 'mapping'"):
        load_mocked_scenario("mapping").check(PlannedRun(0, "mapping", 0, ("mapping:hung@3",)).requests)
