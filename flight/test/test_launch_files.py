"""The launch files of the scenarios, as roslaunch reads them."""

from __future__ import annotations

from pathlib import Path

import pytest
from roslaunch.config import load_config_default

from alula.common.scenarios import load_scenario, scenario_names

LAUNCH = Path(__file__).parents[2] / "ros1_ws/src/uav_bringup/launch"


@pytest.mark.parametrize("scenario", scenario_names())
def test_simulated_time_waits_only_for_nodes_that_the_scenario_starts(scenario: str, tmp_path: Path) -> None:
    launch = LAUNCH / load_scenario(scenario).launch.removeprefix("uav_bringup/")
    config = load_config_default([(str(launch), [f"out:={tmp_path}"])], None, verbose=False, assign_machines=False)
    topics = [word.partition("=")[0] for word in config.params["/uav_simulator/pace_topics"].value.split(",")]
    paced = {topic.split("/")[1] for topic in topics}
    assert {"mission", "uav_guidance"} <= paced
    assert paced <= {node.name for node in config.nodes}
