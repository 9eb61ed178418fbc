"""The wall clock that tests set: what a process under it is told, and how long it waits."""

from __future__ import annotations

import subprocess
import sys

import pytest

from alula_testing.wall_clock import WallClock

HOUR_S = 3600
TOLD = """
import threading, time
print(time.time(), flush=True)
input()
begun_s, wall_s = time.monotonic(), time.time()
time.sleep(0.2)
threading.Event().wait(0.2)
print(wall_s, time.time() - wall_s, time.monotonic() - begun_s)
"""
WAITS = """
#include <chrono>
#include <condition_variable>
#include <cstdio>

int main() {
  std::mutex mutex;
  std::condition_variable never;
  std::unique_lock<std::mutex> lock(mutex);
  const auto end = std::chrono::system_clock::now() + std::chrono::hours(1);
  std::puts("waits");
  std::fflush(stdout);
  never.wait_until(lock, end, [] { return false; });
}
"""


@pytest.mark.parametrize("by_s", [HOUR_S, -HOUR_S])
def test_a_process_is_told_the_time_that_is_set_and_sleeps_as_long_as_before(tmp_path, by_s):
    clock = WallClock(tmp_path)
    words = [sys.executable, "-c", TOLD]
    process = subprocess.Popen(words, env=clock.environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    before_s = float(process.stdout.readline())
    clock.step(by_s)
    rest, _ = process.communicate("\n")
    after_s, wall_s, monotonic_s = map(float, rest.split())
    assert process.returncode == 0
    assert HOUR_S - 60 < abs(after_s - before_s) < HOUR_S + 60
    assert (after_s > before_s) is (by_s > 0)
    assert wall_s == pytest.approx(monotonic_s, abs=0.01)
    assert monotonic_s >= 0.4


def test_a_wait_until_a_time_of_the_wall_clock_ends_when_the_clock_is_set_to_it(tmp_path):
    clock, program = WallClock(tmp_path), tmp_path / "waits"
    program.with_suffix(".cpp").write_text(WAITS, encoding="utf-8")
    subprocess.run(["c++", "-o", str(program), str(program.with_suffix(".cpp")), "-lpthread"], check=True)
    process = subprocess.Popen([str(program)], env=clock.environment, stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "waits\n"
    clock.step(HOUR_S)
    assert process.wait(60.0) == 0
    process.stdout.close()
