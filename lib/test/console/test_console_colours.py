"""What is written can be read in both themes: a contrast of 4.5 to 1 at least (WCAG 2.1, success criterion 1.4.3)."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
from console_page import DRAWN, Page
from console_records import LIFT_OFF_S, failing_story, transition
from console_reports import make_report

from alula.common.record import EVENTS
from alula.report.page.writing import PARTS

LEAST = 4.5
BARS = ("success", "ended", "interrupted", "violated", "failure", "running")
INKS = {
    "bar-ink": BARS,
    "band-ink": ("band-a", "band-b", "alarm"),
    "node-ink": ("skill", "action", "condition", "control", "parallel", "decorator"),
    "ink": ("card", "ground"),
    "soft": ("card", "ground"),
    "card": ("bad", "good", "accent", "detected", "fair", "now"),  # pressed buttons on such a colour, and such words on a card
}
"""Colours of words, and those that they are written on."""
TEXTS_ON_BARS = (
    "[...document.querySelectorAll('#timeline text, #legend text')].filter((one) => one.previousElementSibling?.tagName === 'rect')"
    ".map((one) => [one.textContent, getComputedStyle(one).fill, getComputedStyle(one.previousElementSibling).fill])"
)


def colours(theme: str) -> dict[str, tuple[int, int, int]]:
    style = (PARTS / "page.css").read_text(encoding="utf-8")
    block = style.split(':root[data-theme="dark"] {')[1 if theme == "dark" else 0].split("}")[0]
    return {name: rgb(int(number, 16)) for name, number in re.findall(r"--([\w-]+): #([0-9a-f]{6});", block)}


def rgb(number: int) -> tuple[int, int, int]:
    return (number >> 16, number >> 8 & 255, number & 255)


def computed(text: str) -> tuple[int, int, int]:
    red, green, blue = (int(part) for part in re.findall(r"\d+", text)[:3])
    return (red, green, blue)


def luminance(colour: tuple[int, int, int]) -> float:
    linear = [share / 12.92 if share <= 0.04045 else ((share + 0.055) / 1.055) ** 2.4 for share in (part / 255 for part in colour)]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def contrast(one: tuple[int, int, int], other: tuple[int, int, int]) -> float:
    low, high = sorted((luminance(one), luminance(other)))
    return (high + 0.05) / (low + 0.05)


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_words_stand_out_from_what_they_are_written_on(theme: str) -> None:
    known = colours(theme)
    pairs = [(ink, ground) for ink, grounds in INKS.items() for ground in grounds]
    found = {(ink, ground): round(contrast(known[ink], known[ground]), 2) for ink, ground in pairs}
    assert {pair: ratio for pair, ratio in found.items() if ratio < LEAST} == {}


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_the_words_on_bars_and_bands_stand_out_as_the_browser_draws_them(browser: Any, tmp_path: Path, theme: str) -> None:
    longer = [(LIFT_OFF_S + 1, EVENTS, transition(f"perception.{name}", "OK", "BROKEN")) for name in ("zed_status", "lidar_status")]
    page = Page(browser, make_report(tmp_path, sorted([*failing_story(), *longer], key=lambda entry: entry[0])), theme=theme)
    page.wait(DRAWN)
    drawn = page.run(TEXTS_ON_BARS)
    assert len(drawn) >= len(BARS) + 4
    ratios = {text: contrast(computed(ink), computed(ground)) for text, ink, ground in drawn}
    assert {text: round(ratio, 2) for text, ratio in ratios.items() if ratio < LEAST} == {}
