"""The benchmark counts right: its arithmetic, and one short case each way through a real bridge with real ends."""

import json
import subprocess
import sys

import psutil
import pytest

from alula_testing.waits import until
from bridge_tools import bench, bench_run
from bridge_tools.bench_cases import FLAT_OUT, OFFICIAL, ServiceCase, TopicCase, Way, all_cases
from bridge_tools.bench_ends import protocol


def test_every_case_of_the_official_figures_is_measured():
    measured = {(case.name, case.way) for case in all_cases(10.0)}
    assert set(OFFICIAL) <= measured
    paced = next(case for case in all_cases(10.0) if (case.name, case.way) == ("string", Way.UP))
    assert (paced.number, paced.rate_hz, paced.size_bytes) == (10_000, 1000.0, 64)
    assert next(case for case in all_cases(10.0) if isinstance(case, ServiceCase)).calls == 500


def test_nothing_of_a_bench_that_was_killed_runs_on():
    program = "from bridge_tools.bench_run import Process; print(Process(['sleep', '1000'], {}).pid, flush=True); input()"
    with subprocess.Popen([sys.executable, "-c", program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as bench_itself:
        pid = int(bench_itself.stdout.readline())
        assert psutil.pid_exists(pid)
        bench_itself.kill()
    until(lambda: not psutil.pid_exists(pid), "the process of a bench that was killed has ended")


def test_percentiles_are_of_the_sorted_durations():
    assert protocol.percentiles([]) == {}
    assert protocol.percentiles([7_000_000]) == {"p50_ms": 7.0, "p95_ms": 7.0, "p99_ms": 7.0}
    thousand = [number * 1_000_000 for number in reversed(range(1000))]
    assert protocol.percentiles(thousand) == {"p50_ms": 500.0, "p95_ms": 950.0, "p99_ms": 990.0}


def test_meter_tells_the_first_probes_and_counts_only_messages(capsys):
    meter = protocol.Meter(["/a", "/b"])
    meter.take("/a", 0)
    assert capsys.readouterr().out == ""
    meter.take("/b", 0)
    assert json.loads(capsys.readouterr().out)["event"] == "first"
    assert meter.received == 0
    meter.take("/a", 1)
    meter.take("/b", 1)
    figures = meter.figures()
    assert figures["received"] == 2
    assert figures["p50_ms"] > 0


def test_an_end_is_gone_when_the_bench_is():
    order = {"rate_hz": 10.0, "number": 10, "seconds": 1.0}
    program = f"from bridge_tools.bench_ends import protocol; protocol.send({order}, [lambda _: None], '', lambda *_: None)"
    end = subprocess.run([sys.executable, "-c", program], stdin=subprocess.DEVNULL, timeout=60, check=False)
    assert end.returncode == 1


def test_text_stamps_return():
    assert protocol.read_text_stamp(protocol.text_stamp(123_456_789_012_345) + "...") == 123_456_789_012_345


def test_medians_keep_the_worst_and_rows_tell_it():
    runs = [{"received": number, "sent": 10, "p50_ms": number, "bridge_cpu_s": 0.1, "bridge_peak_mb": 70} for number in (10, 9, 10)]
    figures = bench.medians(runs)
    assert (figures["received"], figures["worst_received"], figures["p50_ms"]) == (10, 9, 10)
    case = TopicCase("string", "string", 64, 1000.0, 10.0, Way.UP)
    line = bench.row(case, figures)
    assert line[:5] == ("string", "1 to 2", "10 of 10 (worst 9)", "10.00", "0.10, 70")
    assert line[5:] == ("10000 of 10000", "0.32 / 0.45", "1.18, 70")
    flat = TopicCase("string flat out", "string", 64, FLAT_OUT, 5.0, Way.UP)
    assert bench.row(flat, figures | {"rate_hz": 7654.4})[2] == "7654 / s"
    assert bench.table([line]).splitlines()[2].startswith("| string | 1 to 2 |")


@pytest.mark.parametrize("arguments", [["--case", "strnig"], ["--repeat", "0"]])
def test_wrong_arguments_end_with_2_and_say_what_there_is(arguments, capsys):
    assert bench.main(arguments) == 2
    assert ("string flat out" if arguments[0] == "--case" else "--repeat") in capsys.readouterr().err


@pytest.mark.parametrize("way", [Way.UP, Way.DOWN])
def test_a_short_case_counts_what_it_sent(ros2_domain, way):
    case = TopicCase("cloud", "cloud", 48_000, 20.0, 1.0, way)
    with bench_run.open_bench() as opened:
        figures = opened.run(case)
    assert figures["sent"] == 20
    assert figures["received"] == 20
    assert 0 < figures["p50_ms"] <= figures["p95_ms"] <= figures["p99_ms"] < 20_000
    assert 0 <= figures["bridge_cpu_s"] < 10
    assert 10 < figures["bridge_peak_mb"] < 1000
