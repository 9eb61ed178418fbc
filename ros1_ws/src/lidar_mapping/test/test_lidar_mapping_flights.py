"""A flight of the simulator along a facade: where the vehicle is, and what is said of how well that is known."""

from __future__ import annotations

import numpy as np
from lidar_mapping_flights import KINDS, Recorder, follow


def test_the_stated_covariance_is_that_of_the_errors_while_the_autopilot_drifts() -> None:
    found = follow(Recorder("yard", seed=0).record(12.0), KINDS["drift5"])
    assert found.slam.count.rejected == 0
    assert found.distance_m.max() < 0.1
    assert found.map_rmse_m < 0.03
    assert np.mean(found.nees[5:]) < 3.0
    assert np.mean(found.sigma_m) < 0.15
