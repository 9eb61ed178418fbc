"""The attacks; each returns what it has found, as plain values for the test to judge."""

from __future__ import annotations

import os
import signal
import subprocess
from collections import Counter
from collections.abc import Callable, Iterable
from typing import Any

from alula.model.execution_state import ExecutionState
from alula.runtime.handle import SkillHandle
from alula_testing.attacks.graph import TIMEOUT_S, Graph, LiveGraph
from alula_testing.navigation import FLYING

Found = dict[str, Any]
SOON_S = 30.0


# --- many requests at once ----------------------------------------------------------------------------------------------


def hundred_transitions(graph: Graph) -> Found:
    """Take 100 transitions at once, every second one there, the others back."""
    client = graph.client()
    asked = [client.transition("homepoint_status", ("VALID", "INVALID")[number % 2]) for number in range(100)]
    return {"unanswered": failures(graph, asked)}


def three_hundred_goals(graph: Graph) -> Found:
    """Ask for 300 executions of a skill of which one can run."""
    fly(graph)
    client = graph.client()
    handles = [client.start("hover", duration=1.0) for _ in range(300)]
    graph.until(lambda: sum(not handle.done for handle in handles) <= 1, "all but one end")
    found = {"outcomes": dict(Counter(handle.state.value for handle in handles))}
    end_all(graph, handles)
    return found | {"messages": sorted({handle.message for handle in handles if handle.state is ExecutionState.FAILED})}


def twenty_pauses(graph: Graph) -> Found:
    """Pause one execution 20 times at once."""
    fly(graph)
    client = graph.client()
    handle = client.start("hover", duration=1.0)
    graph.until(lambda: handle.state is ExecutionState.RUNNING, f"{handle} runs")
    asked = [client.set_paused(handle.id, True) for _ in range(20)]
    found = {"unanswered": failures(graph, asked), "refused": sorted({pending.value for pending in asked if pending.done} - {""})}
    end_all(graph, [handle])
    return found


# --- processes ----------------------------------------------------------------------------------------------------------


def freeze(graph: LiveGraph) -> Found:
    """Freeze the managers until their client gives up what it had started before and meanwhile, then let them go on."""
    fly(graph)
    client = graph.client()
    before = client.start("hover", duration=1.0)
    graph.until(lambda: before.state is ExecutionState.RUNNING, f"{before} runs")
    os.kill(graph.managers.pid, signal.SIGSTOP)
    os.waitid(os.P_PID, graph.managers.pid, os.WSTOPPED | os.WEXITED | os.WNOWAIT)  # on a busy machine threads run on for a while
    meanwhile = client.start("hover", duration=1.0)
    graph.until(lambda: before.done and meanwhile.done, f"{before} and {meanwhile} are given up")
    os.kill(graph.managers.pid, signal.SIGCONT)
    probes: list[SkillHandle] = []

    def one_runs() -> bool:
        if not probes or probes[-1].done:
            probes.append(client.start("hover", duration=1.0))
        return probes[-1].state is ExecutionState.RUNNING

    try:
        graph.until(one_runs, "the axes are given back, so that another execution runs", SOON_S)
    except AssertionError as error:
        return {"before": before.outcome, "meanwhile": meanwhile.outcome, "afterwards": f"{error}: {probes[-1]} {probes[-1].message}"}
    end_all(graph, probes)
    return {"before": before.outcome, "meanwhile": meanwhile.outcome, "afterwards": ""}


def second_managers(graph: LiveGraph) -> Found:
    """Start the managers of the same skillset once more."""
    client = graph.client()
    second = graph.start("server")
    try:
        code: int | None = second.wait(SOON_S)
    except subprocess.TimeoutExpired:
        code = None
    second.kill()
    said = second.communicate()[1]
    return {"code": code, "said": said[-1000:], "unanswered": failures(graph, [client.transition("homepoint_status", "VALID")])}


def unclosed(graph: LiveGraph) -> Found:
    """Run a script that ends without closing its client."""
    fly(graph)
    script = graph.start("unclosed")
    outcome, said = script.communicate(timeout=TIMEOUT_S)
    return {"outcome": outcome.strip(), "code": script.returncode, "said": said[-1000:]}


ATTACKS: dict[str, Callable[[Any], Found]] = {
    attack.__name__: attack for attack in (hundred_transitions, three_hundred_goals, twenty_pauses, freeze, second_managers, unclosed)
}


# --- parts --------------------------------------------------------------------------------------------------------------


def fly(graph: Graph) -> None:
    """Bring the vehicle into the air, as the functional layer does."""
    client = graph.client()
    for resource, state in FLYING.items():
        asked = client.transition(resource, state)
        assert asked.wait(TIMEOUT_S)
        assert asked.value.accepted or asked.value.state == state, asked.value.reason
    graph.until(lambda: all(client.resources.get(name) == state for name, state in FLYING.items()), "the vehicle is in the air")
    graph.until(lambda: client.resources.get("axes_authority") == "AVAILABLE", "the axes are free")


def failures(graph: Graph, asked: Iterable[Any]) -> list[str]:
    """Return why questions have no answer, a reason each."""
    questions = list(asked)
    graph.until(lambda: all(question.done for question in questions), "every question is answered or given up")
    return [question.failure for question in questions if question.failure]


def end_all(graph: Graph, handles: Iterable[SkillHandle]) -> None:
    """Interrupt what runs."""
    for handle in handles:
        handle.interrupt()
        graph.until(lambda handle=handle: handle.done, f"{handle} ends")
