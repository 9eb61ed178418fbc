"""A browser for tests of pages: the fixture ``browser``, for all that pytest runs here."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from typing import Any

import pytest

from alula_testing.waits import HANGS_S

CHROMIUM, DRIVER = shutil.which("chromium"), shutil.which("chromedriver")


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    """Start one for all tests of pages: Debian's chromium, driven by Selenium."""
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
    driver.set_script_timeout(HANGS_S)
    yield driver
    driver.quit()
