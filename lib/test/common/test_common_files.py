"""Files written in one step, YAML with places, requests to end."""

from __future__ import annotations

import json
import os
import signal

import pytest

from alula.common.files import write_aside, write_json, write_text
from alula.common.located_yaml import YamlError, read_yaml
from alula.common.signals import END_SIGNALS, Interrupts
from alula.common.suggestions import nearest


def test_json_is_strict_and_replaces_the_file(tmp_path):
    path = tmp_path / "summary.json"
    write_text(path, "old")
    write_json(path, {"a": float("nan"), "b": (1.5, float("inf")), 3: None})
    assert json.loads(path.read_text()) == {"a": None, "b": [1.5, None], "3": None}
    assert [p.name for p in tmp_path.iterdir()] == ["summary.json"]


def test_a_write_that_fails_leaves_the_old_file_and_nothing_else(tmp_path):
    path = tmp_path / "map.png"
    path.write_bytes(b"old")

    def write(aside):
        aside.write_bytes(b"half")
        raise OSError("disk full")

    with pytest.raises(OSError, match="disk full"):
        write_aside(path, write)
    assert path.read_bytes() == b"old"
    assert [p.name for p in tmp_path.iterdir()] == ["map.png"]


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("a: 1\na: 2\n", "file.yaml:2: the file: `a` is given twice"),
        ("a: 1\nrat: 2\n", "file.yaml:2: the file has no `rat`; it may have a, rate (did you mean `rate`?)"),
        ("- 1\n", "file.yaml:1: the file should be a mapping"),
        ("a: [1\n", "file.yaml:2: is no YAML"),
    ],
)
def test_yaml_errors_name_file_and_line(tmp_path, text, complaint):
    path = tmp_path / "file.yaml"
    path.write_text(text)
    with pytest.raises(YamlError) as error:
        read_yaml(path).record("the file", ("a", "rate"))
    assert str(error.value).startswith(f"{tmp_path}/{complaint}")


def test_a_reader_gets_errors_of_its_own_class(tmp_path):
    class ConfigError(Exception):
        pass

    with pytest.raises(ConfigError, match=r"none.yaml: can't be read: No such file"):
        read_yaml(tmp_path / "none.yaml", ConfigError)


def test_the_first_request_to_end_is_not_the_second():
    asked: list[str] = []
    before = {number: signal.getsignal(number) for number in END_SIGNALS}
    interrupts = Interrupts(lambda: asked.append("in order"), lambda: asked.append("at once"))
    try:
        interrupts.install()
        assert not interrupts.asked
        os.kill(os.getpid(), signal.SIGINT)
        assert (interrupts.asked, interrupts.at_once, asked) == (True, False, ["in order"])
        os.kill(os.getpid(), signal.SIGTERM)
        assert (interrupts.at_once, asked) == (True, ["in order", "at once"])
        assert interrupts.first is signal.SIGINT
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def test_hints_ignore_case_and_list_the_few():
    assert nearest("available", ["AVAILABLE", "USED"]) == "did you mean `AVAILABLE`?"
    assert nearest("flie", ["fly", "replay", "bridge", "interrupt"]) == "did you mean `fly`?"
    assert nearest("xyz", ["mapping"]) == "there is `mapping`"
    assert nearest("xyz", []) == ""
