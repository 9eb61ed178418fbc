"""Skill managers in processes of their own, and what the death of each process does."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

rclpy = pytest.importorskip("rclpy")
pytest.importorskip("mapping_interfaces.action")

from skillset_ros2_kills import END_S, SKILL, Mission  # noqa: E402
from skillset_ros2_rig import SOON_S, Navigation, until  # noqa: E402

from alula.model.execution_state import ExecutionState  # noqa: E402
from alula_testing.navigation import FLYING  # noqa: E402

S = ExecutionState


@pytest.fixture
def mission(ros2_domain):
    mission = Mission(lasts_s=0.0)
    yield mission
    mission.close()


def running(mission):
    """An execution that runs until it is ended."""
    handle = mission.client.start(SKILL)
    until(lambda: handle.state is S.RUNNING, f"{handle} runs", END_S)
    until(lambda: mission.client.resources["mapping_process"] == "RUNNING", "the resource follows")
    until(lambda: any(handle.id in line for line in mission.told), "the hook was called", END_S)
    return handle


def alive(pid: int) -> bool:
    """Return whether a process has not ended; one whose parent does not ask for its end stays as a zombie."""
    try:
        return Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


def runs(mission):
    """An execution that runs, however often it has to be asked for: processes are being restarted."""
    handles = [mission.client.start(SKILL)]

    def one_runs() -> bool:
        if handles[-1].done:
            handles.append(mission.client.start(SKILL))
        return handles[-1].state is S.RUNNING

    until(one_runs, "the skill runs again", END_S)
    return handles[-1]


def test_the_death_of_a_skill_manager_fails_its_execution_and_gives_back_what_it_held(mission):
    handle = running(mission)
    os.kill(mission.pid(SKILL), signal.SIGKILL)
    assert handle.wait(END_S)
    assert handle.state is S.FAILED
    assert handle.message.startswith(f"the manager of {SKILL} has gone: ")
    until(lambda: mission.client.resources["mapping_process"] == "IDLE", "the interrupt effect is applied")
    again = runs(mission)
    again.interrupt()
    assert again.wait(END_S)
    assert again.state is S.INTERRUPTED


def test_the_death_of_the_resource_manager_stops_functions_and_hangs_no_client(mission):
    handle = running(mission)
    os.kill(mission.pid("resources"), signal.SIGKILL)
    assert handle.wait(END_S)
    assert handle.state is S.FAILED
    # The reason is the skill manager's or the client's, the one that notices first; or the client hears the restarted managers before that.
    assert "gone: " in handle.message or "were restarted" in handle.message
    until(lambda: any(line.startswith(f"stopped {SKILL}: the resource manager") for line in mission.told), "the function is stopped", END_S)
    assert runs(mission).state is S.RUNNING


def test_the_processes_end_with_their_supervisor_and_tell_why(mission):
    handle = running(mission)
    assert mission.close() == 0
    assert not handle.done or "shut down" in handle.message or "gone: " in handle.message
    until(lambda: any("shut down" in line for line in mission.told), "the function is stopped for this reason")


def test_a_supervisor_that_is_killed_leaves_no_process_behind(mission):
    pids = [mission.pid("resources"), mission.pid(SKILL)]
    mission.supervisor.kill()
    until(lambda: not any(alive(pid) for pid in pids), "all processes end", END_S)


@pytest.mark.parametrize("words", [["--processes", "both"], ["--part", "nosuch"], ["nosuch"]])
def test_wrong_words_are_told_with_the_code_2(words):
    script = os.path.join(os.path.dirname(__file__), "skillset_ros2_process.py")  # noqa: PTH118, PTH120
    done = subprocess.run([sys.executable, script, *words], capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == 2
    assert words[-1] in done.stderr


@pytest.mark.parametrize("separate", [False, True], ids=["single", "separate"])
def test_robots_stand_side_by_side(spinning, separate):
    one, two = (Navigation(spinning, separate=separate, namespace=f"robot{number}_{separate}") for number in (1, 2))
    one.bring(FLYING)
    handle = one.fly()
    assert two.client.resources["SDK_authority"] == "UNAVAILABLE"
    refused = two.client.start("goto_straight", target=(1, 2, 3), speed=1)
    assert refused.wait(SOON_S)
    assert refused.state is S.NOT_READY
    assert handle.state is S.RUNNING
    assert [execution.id for execution in one.managers.engine.executions] == [handle.id]
    assert {event.id for event in two.events if event.id} <= {refused.id}
    names = {name for name, _ in two.node.get_topic_names_and_types()}
    for number in (1, 2):
        assert f"/robot{number}_{separate}/navigation/events" in names


def test_violations_and_results_are_the_same_when_hooks_are_elsewhere(spinning):
    navigation = Navigation(spinning, separate=True)
    navigation.bring(FLYING)
    hooks = navigation.hooks["goto_straight"]
    seen: list = []
    hooks.acts["on_dispatch"] = seen.append
    hooks.acts["on_violation"] = lambda execution: seen.append((execution.state, execution.result))
    handle = navigation.fly()
    assert seen[0].inputs.speed == 1.0
    until(lambda: handle.progress == 0.5, "progress is reported every period")
    assert seen[0].terminate("ARRIVED", "there")
    assert not seen[0].terminate("ARRIVED")
    assert handle.wait(SOON_S)
    assert (handle.state, handle.result, handle.message) == (S.TERMINATED, "ARRIVED", "there")
    handle = navigation.fly()
    navigation.bring({"SDK_authority": "UNAVAILABLE"})
    assert handle.wait(SOON_S)
    assert (handle.state, handle.result) == (S.RESOURCE_INVARIANT_VIOLATED, "keep_sdk_authority")
    until(lambda: (S.RESOURCE_INVARIANT_VIOLATED, "keep_sdk_authority") in seen, "the hook knows why")
