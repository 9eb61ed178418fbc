"""Makes this folder's helpers importable (pytest's importlib mode does not), and serves a live skillset."""

import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parent))


@pytest.fixture
def spinning(ros2_domain):
    from skillset_ros2_rig import Spinning

    nodes = Spinning()
    yield nodes
    nodes.close()


@pytest.fixture
def navigation(spinning):
    from skillset_ros2_rig import Navigation

    return Navigation(spinning)


@pytest.fixture(params=["single", "separate"])
def anyhow(request, spinning):
    """The navigation with its managers in one node, and in nodes that are linked as processes are."""
    from skillset_ros2_rig import Navigation

    return Navigation(spinning, separate=request.param == "separate")
