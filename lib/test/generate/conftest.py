"""The rover as a folder of models, and the files that are generated from it."""

from __future__ import annotations

import pytest
from generate_rover import BINDINGS, SKILL, TYPES

from alula.generate import robot_files
from alula.language.load import load_robot


@pytest.fixture
def robot_folder(tmp_path):
    folder = tmp_path / "cart"
    folder.mkdir()
    (folder / "rover.skill").write_text(SKILL)
    (folder / "types.yaml").write_text(TYPES)
    (folder / "bindings.yaml").write_text(BINDINGS)
    return folder


@pytest.fixture
def files(robot_folder):
    return robot_files(load_robot(robot_folder))
