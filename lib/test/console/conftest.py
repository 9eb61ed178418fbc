"""What the console's tests share: the folder of a run, and a browser."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from console_records import Story, failing_story, write_map, write_record
from console_serving import WAIT_S

os.environ.setdefault("ALULA_ROOT", str(Path(__file__).resolve().parents[3]))
CHROMIUM, DRIVER = shutil.which("chromium"), shutil.which("chromedriver")


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


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    """A browser for all tests of a page: Debian's chromium, driven by Selenium."""
    if CHROMIUM is None or DRIVER is None:
        pytest.skip("no browser: apt install chromium chromium-driver")
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service

    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM
    for word in ("--headless=new", "--no-sandbox", "--disable-dev-shm-usage"):
        options.add_argument(word)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = webdriver.Chrome(options=options, service=Service(DRIVER))
    driver.set_script_timeout(WAIT_S)
    yield driver
    driver.quit()
