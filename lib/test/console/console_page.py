"""A page in a real browser, and how it is read."""

from __future__ import annotations

import json
from typing import Any

from console_records import LIFT_OFF_S
from console_serving import WAIT_S

SIZES = [(1280, 800), (390, 844)]
DRAWN = "alula.run.count > 0 && document.querySelector('#timeline svg') !== null"
"""A condition: the page has the run's entries and shows them."""
UNNAMED = (
    "[...document.querySelectorAll('button, input, select, progress, canvas, img, [role=img]')].filter((one) => !one.closest('[hidden]') &&"
    "!(one.textContent.trim() || one.getAttribute('aria-label') || one.alt || one.closest('label'))).map((one) => one.outerHTML)"
)
"""Controls and pictures that a screen reader has no name for."""


class Page:
    """A page that is open."""

    def __init__(self, browser: Any, address: str, size: tuple[int, int] = SIZES[0], theme: str = "light") -> None:
        self.browser = browser
        metrics = {"width": size[0], "height": size[1], "deviceScaleFactor": 1, "mobile": size[0] < 500}
        browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
        browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [{"name": "prefers-color-scheme", "value": theme}]})
        browser.get("about:blank")  # ends the page before, which may still ask for its server
        browser.get_log("browser")
        browser.get(address)

    def run(self, script: str) -> Any:
        return self.browser.execute_script(f"return {script}")

    def wait(self, condition: str) -> None:
        from selenium.webdriver.support.ui import WebDriverWait

        WebDriverWait(self.browser, WAIT_S, 0.05).until(lambda _: self.run(condition), f"never: {condition}; {self.text('#headline')}")

    def text(self, selector: str) -> str:
        return str(self.run(f"[...document.querySelectorAll({json.dumps(selector)})].map((one) => one.textContent).join(' | ')"))

    def choose(self, since_lift_off_s: float) -> None:
        self.run(f"alula.choose({LIFT_OFF_S + since_lift_off_s})")
        self.run("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")

    def unfold(self, selector: str) -> None:
        """Open a `details` by the keyboard: what is drawn above it moves it away from a pointer."""
        from selenium.webdriver.common.keys import Keys

        self.browser.find_element("css selector", f"{selector} > summary").send_keys(Keys.ENTER)
        self.wait(f"document.querySelector({json.dumps(selector)} + ' > :not(summary)').checkVisibility()")

    def status(self, node: str) -> str:
        return str(
            self.run(f"[...document.querySelectorAll('.row')].find((row) => row.textContent.includes({json.dumps(node)})).dataset.status")
        )

    def complaints(self) -> list[str]:
        return [str(entry["message"]) for entry in self.browser.get_log("browser")]
