"""The profile of Fast DDS that a process takes which sends no images."""

from __future__ import annotations

import os
from pathlib import Path

from alula.common.fast_dds import PROFILE_VARIABLES, SMALL_SEGMENT_BYTES, small_profile, small_segment

PROFILE = Path(__file__).resolve().parents[3] / "bridge/fastdds.xml"


def test_a_segment_gets_smaller_never_larger_and_nothing_else_changes():
    text = PROFILE.read_text(encoding="utf-8")
    small = small_profile(text)
    assert small == text.replace("<segment_size>67108864<", f"<segment_size>{SMALL_SEGMENT_BYTES}<") != text
    for other in ("<segment_size> 512000 </segment_size>", "<dds/>"):
        assert small_profile(other).replace(" ", "") == other.replace(" ", "")


def test_only_what_is_made_inside_has_it(monkeypatch, tmp_path):
    monkeypatch.setenv(PROFILE_VARIABLES[0], str(PROFILE))
    monkeypatch.delenv(PROFILE_VARIABLES[1], raising=False)
    with small_segment():
        path = Path(os.environ[PROFILE_VARIABLES[0]])
        assert path.read_text(encoding="utf-8") == small_profile(PROFILE.read_text(encoding="utf-8"))
        assert PROFILE_VARIABLES[1] not in os.environ
    assert (os.environ[PROFILE_VARIABLES[0]], path.exists()) == (str(PROFILE), False)
    monkeypatch.setenv(PROFILE_VARIABLES[0], str(tmp_path / "nowhere.xml"))
    with small_segment():  # what is wrong with the file, Fast DDS says
        assert os.environ[PROFILE_VARIABLES[0]] == str(tmp_path / "nowhere.xml")
