"""Which runs are under way, and in which domain."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import pytest

from alula.common.network import claim_domain, is_claimed
from alula.common.processes import RUN_ID_VARIABLE
from alula.common.runs import NoRunError, find_run, live_runs, load_run


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "robot.yaml").write_text("name: rover\n")
    monkeypatch.setenv("ALULA_ROBOT", str(tmp_path))
    (tmp_path / "runs").mkdir()
    return tmp_path / "runs"


def make_run(folder, name: str, domain: object, age_s: float, **more: object):
    place = folder / name
    place.mkdir()
    file = place / "run.json"
    file.write_text(json.dumps({"domain": domain, **more}))
    stamp_s = file.stat().st_mtime - age_s
    os.utime(file, (stamp_s, stamp_s))
    return place


def test_the_newest_run_that_holds_its_domain_is_the_latest(folder):
    with pytest.raises(NoRunError, match="no run is under way"):
        find_run("latest")
    ones = [claim_domain() for _ in range(3)]
    assert all(is_claimed(one.domain) for one in ones)
    make_run(folder, "ended", ones[0].domain, age_s=0)
    make_run(folder, "old", ones[1].domain, age_s=30)
    make_run(folder, "new", ones[2].domain, age_s=20)
    make_run(folder, "long-ago", ones[2].domain, age_s=99)  # had the domain before
    make_run(folder, "broken", "x", age_s=0)
    ones[0].release()
    assert [run.folder.name for run in live_runs() if run.folder.name != "ended"] == ["new", "old"]
    named = find_run(str(folder / "old"))
    assert (named.domain, named.live) == (ones[1].domain, True)
    for one in ones[1:]:
        one.release()


def test_runs_of_one_domain_are_told_apart_by_their_namespaces(folder):
    drone = claim_domain(namespace="/drone")
    rover = claim_domain([drone.domain], "/rover")
    make_run(folder, "flies", drone.domain, age_s=9, namespace="/drone")
    make_run(folder, "flew", drone.domain, age_s=19, namespace="/drone")
    make_run(folder, "drives", rover.domain, age_s=3, namespace="/rover")
    assert [(run.folder.name, run.namespace) for run in live_runs()] == [("drives", "/rover"), ("flies", "/drone")]
    drone.release()
    rover.release()


def test_a_run_that_crashed_is_not_live_because_another_run_has_its_domain_now(folder):
    claim = claim_domain()
    place = make_run(folder, "crashed", claim.domain, age_s=0, run_id="one that crashed")
    with pytest.raises(NoRunError, match="has ended"):
        find_run(str(place))
    words = [sys.executable, "-c", "input()"]
    with subprocess.Popen(words, stdin=subprocess.PIPE, env={**os.environ, RUN_ID_VARIABLE: "one that crashed"}) as process:
        assert find_run(str(place)).live
        process.kill()
    claim.release()


def test_a_run_that_has_ended_or_is_none_is_told(folder):
    claim = claim_domain()
    place = make_run(folder, "one", claim.domain, age_s=0)
    assert load_run(place).live
    claim.release()
    if not is_claimed(claim.domain):  # unless another process has just taken it
        with pytest.raises(NoRunError, match="has ended"):
            find_run(str(place))
    with pytest.raises(NoRunError, match="is no run's folder"):
        find_run(str(folder))
