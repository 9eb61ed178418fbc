"""The suite's own front: its parts, the daily loop, progress, and the browser that it brings."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path
from textwrap import dedent

import psutil
import pytest

from alula_testing.flights import ALULA_ROOT
from alula_testing.progress import time_left_s, told
from alula_testing.waits import HANGS_S, until


def pytest_over(folder: Path, plugin: str) -> list[str]:
    """Return the command that runs a folder's tests as the suite runs a part's."""
    configuration = ["-c", str(ALULA_ROOT / "tests" / "pytest.ini"), "--rootdir", str(folder), "-p", "no:cacheprovider"]
    return [sys.executable, "-m", "pytest", *configuration, "-p", plugin, str(folder)]


def test_time_left_is_by_what_tests_took_last_time_and_by_this_times_pace() -> None:
    last_s = {"a": 1.0, "b": 2.0, "c": 3.0}
    assert time_left_s({}, {}, ["a"]) is None
    assert time_left_s(last_s, {}, ["a", "c"]) == 4.0
    assert time_left_s(last_s, {"a": 2.0}, ["b", "c"]) == 10.0, "it is twice as slow as last time"
    assert time_left_s(last_s, {}, ["b", "new"]) == 4.0, "a new one counts as the mean"


def test_progress_is_one_line() -> None:
    assert told("ROS 1 world", 3, 10, None) == "alula test: ROS 1 world: 3 of 10\n"
    assert told("ROS 1 world", 3, 10, 61.4) == "alula test: ROS 1 world: 3 of 10, 61 s left\n"
    assert told("ROS 1 world", 3, 10, 600.0) == "alula test: ROS 1 world: 3 of 10, 10 min left\n"


PART = """
    import pytest
    from hypothesis import given, strategies

    @pytest.fixture
    def ros2_domain():
        raise AssertionError("a graph was started")

    def test_live(ros2_domain):
        pass

    @pytest.mark.flight
    def test_flight():
        raise AssertionError("it was flown")

    seen = set()

    @given(strategies.integers())
    def test_property(number):
        seen.add(number)

    def test_few_examples():
        assert 1 <= len(seen) <= 10
"""


def test_the_daily_loop_starts_no_graph_and_no_flight_and_looks_at_few_examples(tmp_path: Path) -> None:
    (tmp_path / "test_part.py").write_text(dedent(PART), encoding="utf-8")
    command = pytest_over(tmp_path, "alula_testing.quick")
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=tmp_path)
    assert "2 passed, 2 deselected" in done.stdout, done.stdout + done.stderr


def test_a_part_tells_its_progress_to_the_suite_and_knows_the_time_left_the_second_time(tmp_path: Path) -> None:
    (tmp_path / "test_part.py").write_text("def test_one():\n    pass\n\ndef test_two():\n    pass\n", encoding="utf-8")
    (tmp_path / "conftest.py").write_text("import alula_testing.progress\nalula_testing.progress.EVERY_S = 0.0\n", encoding="utf-8")

    def lines() -> list[str]:
        reading, writing = os.pipe()
        environment = {**os.environ, "ALULA_TEST_PROGRESS": f"{writing}:the part", "ALULA_STATE": str(tmp_path / "state")}
        command = pytest_over(tmp_path, "alula_testing.progress")
        done = subprocess.run(command, cwd=tmp_path, env=environment, pass_fds=[writing], capture_output=True, text=True, check=False)
        os.close(writing)
        assert done.returncode == 0, done.stdout + done.stderr
        with os.fdopen(reading) as told_lines:
            return told_lines.read().splitlines()

    assert [line.partition(",")[0] for line in lines()] == ["alula test: the part: 1 of 2", "alula test: the part: 2 of 2"]
    assert all(line.endswith(" s left") for line in lines())


LEAVES = """
import threading

def test_one():
    pass

def test_two():
    threading.Thread(target=threading.Event().wait, name="left over").start()

def test_three():
    pass
"""


def test_a_thread_that_is_left_over_is_named_with_its_test_and_ends_the_tests(tmp_path: Path) -> None:
    (tmp_path / "test_part.py").write_text(LEAVES, encoding="utf-8")
    (tmp_path / "conftest.py").write_text("import alula_testing.ending\nalula_testing.ending.HANGS_S = 0.5\n", encoding="utf-8")
    done = subprocess.run(pytest_over(tmp_path, "alula_testing.ending"), cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 1, done.stdout + done.stderr
    assert "3 passed" in done.stdout
    told_of = [line for line in done.stderr.splitlines() if line.startswith("alula test:")]
    assert [("left over" in line, line.rpartition(":")[2]) for line in told_of] == [(True, "test_two")]


HANGS_IN_C = """
import ctypes

def test_hangs():
    lock, keeping_the_interpreter = ctypes.create_string_buffer(64), ctypes.PyDLL(None)
    for _ in range(2):
        keeping_the_interpreter.pthread_mutex_lock(lock)
"""


def test_a_call_in_c_that_never_returns_is_named_with_its_test_and_ends_the_tests(tmp_path: Path) -> None:
    (tmp_path / "test_part.py").write_text(HANGS_IN_C, encoding="utf-8")
    (tmp_path / "conftest.py").write_text("import alula_testing.ending\nalula_testing.ending.WATCHDOG_S = 1.0\n", encoding="utf-8")
    command = [*pytest_over(tmp_path, "alula_testing.ending"), "-o", "timeout=1"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False, timeout=HANGS_S)
    assert done.returncode == 1
    assert f'"{tmp_path / "test_part.py"}", line 7 in test_hangs' in done.stderr


def test_an_expression_that_is_called_as_a_folder_is_selects_tests_and_no_part() -> None:
    command = [ALULA_ROOT / "tests/run", "tests/test_manifests.py", "-k", "lib", "--collect-only"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert [line for line in done.stdout.splitlines() if line.startswith("==")] == ["== across the rooms: tests/test_manifests.py =="]
    assert "2 deselected" in done.stdout


PLACES = {
    "ROS 1 world": "flight/test/test_members.py",
    "ROS 2 world": "ros2_ws/src/skill_panel/test/test_skill_panel_view.py",
    "bridge": "bridge/ros_bridge/test/test_ros_bridge_layout.py",
    "across the rooms": "tests/test_manifests.py",
    "builds and Pythons": "tests/test_pythons.py",
    "early ends and the rover": "tests/test_endings.py",
    "flights": "tests/test_flights.py",
    "proofs": "lib/test/prove/skillset",
    "missions": "lib/test/trees",
    "repairs and campaigns": "lib/test/repair/test_repair_words.py",
    "library": "lib/test/model",
}


def environment_of_a_suite(state: Path) -> dict[str, str]:
    """Return the environment of a suite with what is installed here, and logs of its own."""
    for entry in Path(os.environ["ALULA_STATE"]).iterdir():
        if not entry.name.startswith("test-"):
            (state / entry.name).symlink_to(entry)
    environment = {name: value for name, value in os.environ.items() if not name.startswith("OMP_")}  # by which nproc goes
    return {**environment, "ALULA_STATE": str(state)}


def test_each_part_is_run_once_though_there_are_more_than_lanes_and_shown_one_after_the_other(tmp_path: Path) -> None:
    command = [ALULA_ROOT / "tests/run", *PLACES.values(), "-k", "no_test_is_called_so"]
    environment = environment_of_a_suite(tmp_path)
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment, cwd=ALULA_ROOT)
    assert done.returncode == 5, done.stdout + done.stderr
    shown = [line for line in done.stdout.splitlines() if line.startswith("==") and line.endswith("==") and "/" in line]
    assert shown == [f"== {name}: {place} ==" for name, place in PLACES.items()]
    logs = {path.name: path.read_text(encoding="utf-8") for path in tmp_path.glob("test-*.log")}
    assert {name: log.splitlines()[0] for name, log in logs.items()} == {
        f"test-{name.replace(' ', '-')}.log": f"== {name}: {place} ==" for name, place in PLACES.items()
    }


WAITS = """
    import os, pathlib, subprocess, time
    import pytest

    HERE = pathlib.Path(__file__).parent

    @pytest.fixture
    def started():
        child = subprocess.Popen(["sleep", "1000"], start_new_session=True)
        yield child
        child.kill()
        child.wait()

    def test_waits(started):
        (HERE / "coming").write_text(f"{os.getpid()} {started.pid}")
        (HERE / "coming").rename(HERE / "pids")
        time.sleep(1000)
"""
AT_A_TERMINAL = ("env", "--default-signal=INT")  # also where these tests are a script's
AS_A_SCRIPT_STARTS_IT = 'trap "" INT; exec "$0" "$@"'  # in its background


@pytest.mark.parametrize(("shell", "number"), [(AT_A_TERMINAL, signal.SIGINT), (("sh", "-c", AS_A_SCRIPT_STARTS_IT), signal.SIGTERM)])
def test_a_suite_that_is_ended_early_ends_all_its_parts_with_what_they_started(tmp_path: Path, shell: tuple[str, ...], number: int) -> None:
    (tmp_path / "state").mkdir()
    (tmp_path / "test_waits.py").write_text(dedent(WAITS), encoding="utf-8")
    command = [*shell, ALULA_ROOT / "tests/run", tmp_path / "test_waits.py", PLACES["ROS 1 world"]]
    environment, told = environment_of_a_suite(tmp_path / "state"), subprocess.DEVNULL
    with subprocess.Popen(command, cwd=ALULA_ROOT, env=environment, stdout=told, stderr=told, start_new_session=True) as front:
        until((tmp_path / "pids").exists, "the test has begun")
        pids = [int(pid) for pid in (tmp_path / "pids").read_text(encoding="utf-8").split()]
        assert all(psutil.pid_exists(pid) for pid in pids)
        front.send_signal(number)
        assert front.wait(HANGS_S) == 130
        assert not any(psutil.pid_exists(pid) for pid in pids)


DPKG = """\
#!/bin/sh
sed 's/^/installed /' "{packages}"
"""
APT = """\
#!/bin/sh
[ "$1" != install ] || for word; do case $word in chromium*) echo $word >>"{packages}"; echo $word >>"{packages}.new" ;; esac; done
"""


@pytest.mark.parametrize("there", [(), ("chromium", "chromium-driver")])
def test_the_browser_is_brought_where_it_is_missing_and_only_where_it_is_asked_for(tmp_path: Path, there: tuple[str, ...]) -> None:
    tools, state, packages = tmp_path / "bin", tmp_path / "state", tmp_path / "packages"
    tools.mkdir()
    state.mkdir()
    listed = [line for line in (ALULA_ROOT / "setup" / "apt.txt").read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    packages.write_text("\n".join([*listed, *there, ""]), encoding="utf-8")
    for name, text in {"dpkg-query": DPKG, "apt-get": APT, "apt-cache": "#!/bin/sh\n", "sudo": '#!/bin/sh\nexec "$@"\n'}.items():
        (tools / name).write_text(text.format(packages=packages), encoding="utf-8")
        (tools / name).chmod(0o755)
    environment = {**os.environ, "PATH": f"{tools}:{os.environ['PATH']}", "ALULA_STATE": str(state)}

    def setup(steps: str) -> str:
        command = [ALULA_ROOT / "setup" / "setup.sh", "--quiet", "--only", steps]
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        new = tmp_path / "packages.new"
        return " ".join(new.read_text(encoding="utf-8").split()) if new.exists() else ""

    wanted = "" if there else "chromium chromium-driver"
    assert setup("apt") == ""
    assert setup("browser") == wanted
    assert setup("browser") == wanted, "it was there the second time"
