"""A thousand executions in a row leave memory and open files where they were."""

from __future__ import annotations

import gc
import os
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest

rclpy = pytest.importorskip("rclpy")
pytest.importorskip("navigation_interfaces.action")

from skillset_ros2_rig import SOON_S  # noqa: E402

from alula.model.execution_state import ExecutionState  # noqa: E402
from alula_testing.navigation import FLYING  # noqa: E402
from alula_testing.waits import until  # noqa: E402

WARM, MEASURED = 300, 1000
"""The events' topic keeps the last 1000 of them: four of each execution, and it is full."""
GROWTH_KB = 8000
"""Of all of the process, rclpy and DDS included; goals that rcl keeps for late questions are part of it."""

PYTHONS_OWN = (700, 10, 10)
"""The collector's thresholds in CPython 3.11 (documentation of ``gc.set_threshold``)."""


def rss_kb() -> int:
    """Resident memory of this process."""
    line = next(line for line in Path("/proc/self/status").read_text(encoding="ascii").splitlines() if line.startswith("VmRSS"))
    return int(line.split()[1])


def open_files() -> int:
    return len(os.listdir("/proc/self/fd"))  # noqa: PTH208


def own_objects() -> Counter[str]:
    """How many objects of each class of this package live."""
    gc.collect()
    classes = (type(thing) for thing in gc.get_objects())
    return Counter(kind.__name__ for kind in classes if str(kind.__module__).startswith("alula.runtime."))


@pytest.fixture
def collects_as_managers_do() -> Iterator[None]:
    """Have Python's collector look as often as in a process of managers: tests have it look less often."""
    before = gc.get_threshold()
    gc.set_threshold(*PYTHONS_OWN)
    yield
    gc.set_threshold(*before)


@pytest.mark.usefixtures("collects_as_managers_do")
def test_a_thousand_executions_leave_nothing_behind(navigation):
    navigation.bring(FLYING)
    navigation.hooks["hover"].acts["on_dispatch"] = lambda execution: execution.terminate("DONE")

    def run(times: int) -> None:
        for _ in range(times):
            handle = navigation.client.start("hover", duration=1.0)
            assert handle.wait(SOON_S)
            assert handle.state is ExecutionState.TERMINATED
        navigation.events.clear()
        navigation.hooks["hover"].calls.clear()

    run(WARM)
    objects = own_objects()  # collects, so that memory is measured without garbage: with many objects alive that is rarely collected
    files, memory_kb = open_files(), rss_kb()
    assert objects["SkillManager"] >= len(navigation.hooks)  # they are found at all
    run(MEASURED)
    growth_kb = rss_kb() - memory_kb
    assert open_files() <= files
    assert growth_kb < GROWTH_KB, f"{growth_kb} kB more after {MEASURED} executions"
    more = Counter()

    def few_more() -> bool:
        more.clear()
        more.update(own_objects() - objects)
        return more.total() < MEASURED / 20

    # Timers that were cancelled stay until their moment; what leaks stays for good.
    until(few_more, "few objects are left", SOON_S, every_s=0.5)
    assert navigation.managers.engine.executions == ()
    assert navigation.managers.engine._context.entries == {}
    print(f"{growth_kb} kB, {open_files() - files} files, {more.total()} objects more")  # noqa: T201
