"""The command line of the check: exit codes 0, 1, 2, text and JSON."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

from skill_language.check_cli import main

SOUND = "skillset s { skill f { result { R } } }"
WARNED = "skillset s { type P }"
WRONG = "skillset s { skill f { progress = 0 } }"
BROKEN = "skillset s { skil }"


def write(folder, **texts):
    for name, text in texts.items():
        (folder / f"{name}.skill").write_bytes(text.encode() if isinstance(text, str) else text)
    return [str(folder / f"{name}.skill") for name in texts]


@pytest.mark.parametrize(
    ("texts", "code"),
    [
        ({"a": SOUND}, 0),
        ({"a": WARNED}, 0),
        ({"a": SOUND, "b": WRONG}, 1),
        ({"a": BROKEN}, 1),
        ({"a": ""}, 1),
        ({"a": b"\xff\xfe"}, 2),
        ({"a": BROKEN, "b": b"\xff\xfe"}, 2),
    ],
)
def test_exit_codes(tmp_path, capsys, texts, code):
    assert main(write(tmp_path, **texts)) == code
    told = capsys.readouterr().out
    for name in texts:
        assert f"{name}.skill: " in told


def test_a_file_that_is_not_there(tmp_path, capsys):
    assert main([str(tmp_path / "x.skill")]) == 2
    assert "x.skill: error ALU001: can't be read" in capsys.readouterr().out


def test_text(tmp_path, capsys):
    main(write(tmp_path, a=SOUND, b=WRONG, c=WARNED))
    lines = capsys.readouterr().out.splitlines()
    assert [line.rsplit("/", 1)[-1] for line in lines if line.endswith(("ok", "errors", "error", "warning"))] == [
        "a.skill: ok",
        "b.skill: 1 error, 1 warning",
        "c.skill: 1 warning",
    ]


def test_json(tmp_path, capsys):
    (path,) = write(tmp_path, a=WRONG)
    assert main([path, "--json"]) == 1
    document = json.loads(capsys.readouterr().out)
    assert document["exit_code"] == 1
    (file,) = document["files"]
    assert file["file"] == path
    assert file["findings"][1] == {
        "code": "ALU211",
        "severity": "error",
        "message": "the progress period of `f` is 0 s; it must be positive",
        "file": path,
        "line": 1,
        "column": 24,
        "end_column": 36,
        "hint": "",
        "expected": [],
        "counterexample": None,
    }


def test_as_a_program(tmp_path):
    (path,) = write(tmp_path, a=BROKEN)
    done = subprocess.run([sys.executable, "-m", "skill_language.check_cli", path], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "did you mean `skill`?" in done.stdout
    assert done.stderr == ""
    done = subprocess.run([sys.executable, "-m", "skill_language.check_cli"], capture_output=True, text=True, check=False)
    assert done.returncode == 2
