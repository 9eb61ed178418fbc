"""A robot, a deployment of it, and its parts under a keeper, for tests of what stays up between missions."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from alula.common.deployments import Deployment
from alula.common.robots import VARIABLE as ROBOT
from alula.generate.scaffold.skeleton import files_of
from alula_flight.station import keeper as keepers
from alula_flight.station.keeper import Kept as KeptPart
from alula_flight.station.parts import Places
from alula_flight.station.state import PartState

sys.path.append(str(Path(__file__).parent))  # pytest's importlib mode does not

from station_rig import ROOT


@pytest.fixture
def places(tmp_path):
    places = Places(ROOT, tmp_path / "robot/.alula", tmp_path / "robot/.alula/up/lab")
    for folder in (places.logs, places.bags, places.robot / "generated"):
        folder.mkdir(parents=True)
    return places


@pytest.fixture
def deployment(tmp_path):
    return Deployment("lab", tmp_path / "robot/deployments/lab.yaml", master="http://10.0.0.1:11311", address="10.0.0.2", domain=7)


@pytest.fixture
def robot(tmp_path, monkeypatch):
    """A new robot, and the deployment that it has."""
    root = tmp_path / "rover"
    for path, text in files_of("rover").items():
        (root / path).parent.mkdir(parents=True, exist_ok=True)
        (root / path).write_text(text, encoding="utf-8")
    monkeypatch.setenv(ROBOT, str(root))
    monkeypatch.setenv("ALULA_ROBOT_STATE", str(root / ".alula"))
    monkeypatch.setenv("ALULA_ROOT", str(ROOT))
    return root


@pytest.fixture
def kept(places, monkeypatch):
    """What keeps a part up, which is started again at once."""
    monkeypatch.setattr(keepers, "AGAIN_S", 0.0)
    made = []

    def make(part):
        made.append(KeptPart(part, PartState(), places))
        return made[-1]

    yield make
    for one in made:
        one.end()
