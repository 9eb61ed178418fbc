"""The robots of the rig: what runs on their base, what is up on the decision computer, how short a mission is, and when they move."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from link_rig.verdicts import STANDS, Still

ALULA_ROOT = Path(__file__).resolve().parents[2]
ROVER = ALULA_ROOT / "examples/rover"
UAV = ALULA_ROOT / "ros1_ws/src"
BRAKES_S = 1.1  # from 1 m/s; measured: 0.5 to 0.7 s, then it swings back, at 0.3 m/s at most, for half a second


@dataclass(frozen=True)
class Robot:
    """A robot with one scenario.

    Attributes:
        scenario: as `alula run` takes it.
        folder: of the robot.
        launch: of its base, with simulator; ``arguments`` of it beside world and folder.
        world: what is simulated; a mission has ``shorter`` in it, which replaces its keys.
        dead_man: configuration of `alula_base`.
        hooks: what makes them, by skillset.
        bridge: its generated configuration.
        still: how slowly it moves when it stands.
        goal_m: along x, where the mission's only leg ends; 0 where it does not fly.
    """

    scenario: str
    folder: Path
    launch: Path
    world: Path
    shorter: Mapping[str, Any]
    dead_man: Path
    hooks: Mapping[str, str]
    bridge: str
    arguments: Mapping[str, str] = field(default_factory=dict)
    still: Still = STANDS
    goal_m: float = 0.0

    @property
    def moves_by(self) -> str:
        """Return the topic of the heartbeats of the managers that move it."""
        return "/navigation/alive" if self.still.flies else "/base/alive"


def _drone(scenario: str, world: str, skillsets: tuple[str, ...], goal_m: float) -> Robot:
    return Robot(
        scenario,
        ALULA_ROOT,
        UAV / f"uav_bringup/launch/{scenario}.launch",
        UAV / f"uav_simulator/worlds/{world}.yaml",
        {"route": [[0.0, 0.0, 3.0], [goal_m, 0.0, 3.0]]},
        UAV / "uav_bringup/config/dead_man.yaml",
        {name: f"uav_skills.{name}:make_hooks" for name in skillsets},
        "uav_bridge.yaml",
        {"decision": "false", "lockstep": "false"},
        Still(m_s=0.3, rad_s=0.2, flies=True, brakes_s=BRAKES_S),
        goal_m,
    )


PATROL = Robot(
    "patrol",
    ROVER,
    ROVER / "ros1_ws/src/rover_navigation/launch/functional.launch",
    ROVER / "worlds/office.yaml",
    {"rounds": ["corridor_east"]},
    ROVER / "ros1_ws/src/rover_navigation/config/dead_man.yaml",
    {name: f"rover_robot.hooks.{name}:make_hooks" for name in ("base", "perception", "power", "cargo")},
    "rover_bridge.yaml",
)
SLOW_PATROL = replace(PATROL, arguments={"rate": "0.2"})
MAPPING = _drone("mapping", "yard", ("navigation", "perception", "mapping"), 14.0)
INSPECTION = _drone("inspection", "building", ("navigation", "perception", "video"), 14.0)
