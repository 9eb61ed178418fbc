"""The command line of the check: exit codes 0, 1, 2, text and JSON."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import pytest

from alula.cli.check import main

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
    main(write(tmp_path, a=SOUND, b=WRONG.replace("skillset s", "skillset b"), c=WARNED.replace("skillset s", "skillset c")))
    lines = capsys.readouterr().out.splitlines()
    assert [line.rsplit("/", 1)[-1] for line in lines if line.endswith(("ok", "errors", "error", "warning"))] == [
        "a.skill: ok",
        "b.skill: 1 error, 1 warning",
        "c.skill: 1 warning",
    ]


def test_json(tmp_path, capsys):
    (path,) = write(tmp_path, a=WRONG)
    assert main([path, "--json"]) == 1
    told = capsys.readouterr().out
    assert told.count("\n") == 1
    document = json.loads(told)
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
        "steps": None,
    }


def test_as_a_program(tmp_path):
    (path,) = write(tmp_path, a=BROKEN)
    done = subprocess.run([sys.executable, "-m", "alula.cli.check", path], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "did you mean `skill`?" in done.stdout
    assert done.stderr == ""
    nowhere = {**os.environ, "ALULA_ROBOT": ""}
    done = subprocess.run([sys.executable, "-m", "alula.cli.check"], cwd=tmp_path, env=nowhere, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "robot.yaml" in done.stderr


UAV = """
type Pose

skillset uav {
  data pose: Pose period 100 ms
  resource {
    authority {
      state { Pilot Drone None }
      initial Pilot
      transition { Pilot -> None  None -> Pilot  None -> Drone  Drone -> None }
    }
    motion { state { Free Used } initial Free transition all }
  }
  event {
    pilot_lets_go { guard authority == Pilot effect authority -> None }
    drone_takes { guard authority == None effect authority -> Drone }
    drone_lets_go { guard authority == Drone effect authority -> None }
  }
  skill goto {
    input target: Pose
    precondition { no_pilot: authority != Pilot  free: motion == Free }
    start motion -> Used
    invariant {
      in_control { guard authority == Drone effect motion -> Free }
    }
    interrupt { interrupting false effect motion -> Free }
    success arrived { effect motion -> Free postcondition motion == Free }
    failure blocked { effect motion -> Free }
  }
}
"""


def test_a_proof_that_fails_is_told_with_its_place_its_line_and_its_counterexample(tmp_path, capsys):
    path = tmp_path / "uav.rl"
    path.write_text(UAV)
    assert main([str(path), "--json"]) == 1
    (file,) = json.loads(capsys.readouterr().out)["files"]
    (finding,) = [f for f in file["findings"] if f["severity"] == "error"]
    line = next(number for number, text in enumerate(UAV.split("\n"), 1) if "in_control" in text)
    assert (finding["code"], finding["line"], finding["column"]) == ("ALU510", line, 7)
    assert finding["counterexample"][0] == "authority == None"
    assert finding["counterexample"][-1].endswith("`in_control` of goto is false and ends it: motion Used -> Free")
    assert main([str(path)]) == 1
    assert f"{line:5} |       in_control {{ guard authority == Drone" in capsys.readouterr().out
    path.write_text(UAV.replace("authority != Pilot", "authority == Drone"))
    assert main([str(path)]) == 0
