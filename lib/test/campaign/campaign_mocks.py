"""Mock flights that leave their record."""

from __future__ import annotations

from pathlib import Path

from alula.campaign.mocked_scenarios import load_mocked_scenario
from alula.campaign.plan import PlannedRun
from alula.missions.mocked import MockedMission


def fly_recorded(out: Path, *faults: str, kill: tuple[str, float] | None = None) -> MockedMission:
    """Map the yard over mocks; ``out`` is the run's folder, which is there; ``kill``: the managers of which skillset die when."""
    flights = load_mocked_scenario("mapping")
    requests = PlannedRun(0, "mapping", 0, faults).requests
    mission = MockedMission(flights.skillsets, flights.behaviour, flights.plan, faults=requests, out=out)
    if kill is not None:
        mission.world.clock.after(kill[1], lambda: mission.world.kill(kill[0]))
    mission.run()
    return mission
