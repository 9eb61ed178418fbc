"""What is configured: read as it is meant, or refused with the parameter's name and what it has to be."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from alula_base.errors import ConfigError
from alula_base.settings import KINDS, CancelSettings, ReportSettings, ScriptSettings, ServiceSettings, ZeroSettings, read_settings

GOOD = {"heartbeats": ["/rover/alive"], "stop": {"wheels": {"zero": "/cmd_vel"}}}


def test_all_that_can_be_configured():
    settings = read_settings(
        {
            "heartbeats": ["/rover/alive", "arm/alive"],
            "silent_after_s": 1,
            "stop": {
                "wheels": {"zero": "/cmd_vel", "rate_hz": 20, "for_s": 3.5},
                "brake": {"service": "/brake/set", "type": "std_srvs/SetBool", "request": {"data": True}, "within_s": 1.5},
                "navigation": {"cancel": "/move_base", "after_s": 8},
                "tell": {"script": ["logger", "stopped"]},
            },
            "report": {"skillset": "rover", "resource": "link", "heard": "UP", "silent": "DOWN"},
        }
    )
    assert (settings.heartbeats, settings.silent_after_s) == (("/rover/alive", "arm/alive"), 1.0)
    assert settings.stop == {
        "wheels": ZeroSettings("/cmd_vel", 20.0, 3.5),
        "brake": ServiceSettings("/brake/set", "std_srvs/SetBool", {"data": True}, 1.5),
        "navigation": CancelSettings("/move_base", 5.0, after_s=8.0),
        "tell": ScriptSettings(("logger", "stopped"), 10.0),
    }
    assert settings.report == ReportSettings("rover", "link", "UP", "DOWN")


def test_the_readme_shows_what_can_be_read():
    text = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")
    settings = read_settings(yaml.safe_load(text.split("```yaml\n")[1].split("```")[0]))
    assert sorted(type(one).__name__ for one in settings.stop.values()) == sorted(kind.__name__ for kind in KINDS.values())
    assert settings.report == ReportSettings("rover", "link", "UP", "DOWN")


def test_what_need_not_be_said():
    settings = read_settings(GOOD)
    assert (settings.silent_after_s, settings.report) == (2.0, None)
    assert settings.stop["wheels"] == ZeroSettings("/cmd_vel", 10.0, 5.0)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"heartbeat": "/a"}, "unknown parameter ~heartbeat; known: heartbeats, stop, silent_after_s, report"),
        ({"heartbeats": []}, "~heartbeats is [], expected a list that is not empty"),
        ({"heartbeats": "/a"}, "~heartbeats is '/a', expected a list that is not empty"),
        ({"heartbeats": ["/a", "b c"]}, "~heartbeats[1] is 'b c', expected a name on the graph, as /base/stop"),
        ({"silent_after_s": "2"}, "~silent_after_s is '2', expected a number above 0, of at most 3600"),
        ({"silent_after_s": True}, "~silent_after_s is True, expected a number above 0, of at most 3600"),
        ({"silent_after_s": 0}, "~silent_after_s is 0, expected a number above 0, of at most 3600"),
        ({"silent_after_s": float("nan")}, "~silent_after_s is nan, expected a number above 0, of at most 3600"),
        ({"stop": {}}, "~stop is empty, expected what is called when nothing is heard, by name"),
        ({"stop": {"a": {}}}, "~stop/a has nothing to call, expected one of service, zero, cancel, script"),
        ({"stop": {"a": {"zero": "/a", "cancel": "/b"}}}, "~stop/a has zero and cancel, expected one of service, zero, cancel, script"),
        ({"stop": {"a": {"zero": "/a", "within_s": 1}}}, "unknown parameter ~stop/a/within_s; known: zero, rate_hz, for_s, after_s"),
        ({"stop": {"a": {"service": "/a"}}}, "parameter ~stop/a/type is missing"),
        (
            {"stop": {"a": {"service": "/a", "type": "SetBool"}}},
            "~stop/a/type is 'SetBool', expected a service's type, as std_srvs/SetBool",
        ),
        (
            {"stop": {"a": {"zero": "/a", "after_s": -1}}},
            "~stop/a/after_s is -1, expected a number above 0, of at most 3600",
        ),
        (
            {"stop": {"a": {"service": "/a", "type": "a/B", "request": [1]}}},
            "~stop/a/request is [1], expected keys and values",
        ),
        ({"stop": {"a": {"script": [""]}}}, "~stop/a/script[0] is '', expected a word"),
        ({"report": {"skillset": "rover"}}, "parameter ~report/resource is missing"),
    ],
)
def test_what_is_wrong_is_told(change, told):
    with pytest.raises(ConfigError) as error:
        read_settings({**GOOD, **change})
    assert str(error.value) == told


@pytest.mark.parametrize("name", GOOD)
def test_what_is_missing_is_told(name):
    with pytest.raises(ConfigError, match=f"parameter ~{name} is missing"):
        read_settings({key: value for key, value in GOOD.items() if key != name})
