"""Makes this folder's helpers importable (pytest's importlib mode does not), and serves a live skillset."""

import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parent))


@pytest.fixture
def spinning(ros2_domain):
    from skill_runtime_rig import Spinning

    nodes = Spinning()
    yield nodes
    nodes.close()


@pytest.fixture
def navigation(spinning):
    from skill_runtime_rig import Navigation

    return Navigation(spinning)
