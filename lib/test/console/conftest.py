"""What the console's tests share: the folder of a run."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path

import pytest
from console_records import Story, failing_story, write_map, write_record
from console_serving import WAIT_S

from alula.console import server

os.environ.setdefault("ALULA_ROOT", str(Path(__file__).resolve().parents[3]))


@pytest.fixture(autouse=True)
def _patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have a server of this process wait longer for slow peers: on a busy machine the tests' own clients are slow."""
    for limit in ("OPEN_S", "HELLO_S", "STUCK_S"):
        monkeypatch.setattr(server, limit, WAIT_S)


@pytest.fixture
def make_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Path]:
    """Make a run's folder; it stands among the runs that the console finds."""
    runs = tmp_path / "runs"
    monkeypatch.setattr("alula.console.server.runs_folder", lambda: runs)
    monkeypatch.setattr("alula.console.acts.runs_folder", lambda: runs)

    def make(name: str = "run", *, story: Story | None = None) -> Path:
        folder = runs / name
        write_record(folder, failing_story() if story is None else story)
        run = {
            "scenario": "mapping",
            "seed": 1,
            "faults": ["zed@30"],
            "world": "yard.yaml",
            "mock": False,
            "domain": 101,
            "run_id": f"id-{name}",
        }
        (folder / "run.json").write_text(json.dumps(run), encoding="utf-8")
        write_map(folder / "map.ply")
        return folder

    return make
