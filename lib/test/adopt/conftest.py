"""A robot that is made of trees is the one that commands are about."""

from __future__ import annotations

import pytest

from alula.common.robots import VARIABLE


@pytest.fixture
def about(monkeypatch):
    """Have commands be about a robot's folder, and begin there."""

    def choose(folder):
        monkeypatch.setenv(VARIABLE, str(folder))
        monkeypatch.chdir(folder)
        return folder

    return choose
