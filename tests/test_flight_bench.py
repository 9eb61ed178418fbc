"""What a run took is counted once, whoever took it: the kernel's figure of the whole tree is what all rows sum up to."""

from __future__ import annotations

import os
import resource
import sys
from pathlib import Path

import pytest

from flight_bench.__main__ import environment_of, main
from flight_bench.figures import Figures, as_json, ratio, table
from flight_bench.picture import draw
from flight_bench.watching import FRONT, PHASES, SUPERVISOR, UNSEEN, Watched, watch

BUSY = "import time\nwhile time.process_time() < {s}: pass\n"
TREE = f"""
import subprocess, sys
long = subprocess.Popen([sys.executable, "-c", {BUSY.format(s=1.0)!r}, "__name:=camera"])
for _ in range(3):
    subprocess.run([sys.executable, "-c", "pass"])
subprocess.run([sys.executable, "-c", {BUSY.format(s=0.6)!r}, "alula_flight.supervisor"])
long.wait()
{BUSY.format(s=0.5)}
"""


def test_rows_are_the_processes_and_sum_up_to_what_the_kernel_tells(tmp_path: Path) -> None:
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    taken = watch([sys.executable, "-c", TREE], tmp_path / "run", tmp_path / "words.txt")
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    whole_s = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    assert taken.code == 0
    assert {FRONT, SUPERVISOR, "camera"} <= set(taken.cpu_s) <= {FRONT, SUPERVISOR, "camera", UNSEEN}
    # The last look at a process is up to a fifth of a second before its end, on a busy machine more; nothing is counted twice.
    assert sum(row[phase] for row in taken.cpu_s.values() for phase in PHASES) == pytest.approx(whole_s, abs=0.05)
    assert 0.0 < sum(taken.cpu_s["camera"].values()) < 1.2
    assert sum(taken.cpu_s[SUPERVISOR].values()) < 0.8
    assert set(taken.memory_mb) <= set(taken.cpu_s)


def test_medians_ratios_and_files_tell_of_each_checkout(tmp_path: Path) -> None:
    taken = watch([sys.executable, "-c", BUSY.format(s=0.3)], tmp_path / "run", tmp_path / "words.txt")
    flights = [Figures("here", "accomplished", taken, {"map_rmse_m": rmse_m}) for rmse_m in (0.03, 0.05, 0.04)]
    shown = table(flights)
    assert "3 flown, accomplished; map_rmse_m 0.04" in shown
    assert f"| {FRONT} |" in shown
    assert ratio(flights, flights).startswith("processor time, first by second: all 1.00 (1.00 to 1.00)")
    assert [one["checkout"] for one in as_json(flights)] == ["here"] * 3


@pytest.mark.parametrize(("name", "magic"), [("cost.svg", b"<?xml"), ("cost.png", b"\x89PNG")])
def test_the_picture_has_each_process(tmp_path: Path, name: str, magic: bytes) -> None:
    cost = [{"camera": {"start": 0.5, "flight": 2.0, "report": 0.0}, FRONT: {"start": 0.3, "flight": 0.1, "report": 1.25}}, {}]
    flown = [[Figures(f"/checkouts/{n}", "accomplished", Watched(0, one, {}, {}), {})] for n, one in enumerate(cost)]
    draw(flown, tmp_path / name)
    drawn = (tmp_path / name).read_bytes()
    assert drawn.startswith(magic)
    if name.endswith("svg"):
        words = {text for text in drawn.decode().replace("<", ">").split(">") if text.strip()}
        assert {"camera", FRONT, "start", "flight", "report", "2.5", "1.6", "0: 4 s in all", "1: 0 s in all"} <= words


def test_another_checkout_is_told_nothing_of_where_this_one_lies(tmp_path: Path) -> None:
    own = Path(os.environ["ALULA_ROOT"])
    assert environment_of(own) == dict(os.environ)
    told = environment_of(tmp_path)
    assert not any(str(own) in value for name, value in told.items() if name.startswith("ALULA"))
    assert told["PATH"]


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["--repeat", "0"], "at least one flight"),
        (["--vs", "no/such/checkout"], "no/such/checkout"),
        (["--picture", "cost.txt"], ".png or .svg"),
    ],
)
def test_wrong_input_is_named(arguments: list[str], named: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    assert ended.value.code == 2
    assert named in capsys.readouterr().err
