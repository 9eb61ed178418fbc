"""What the functions of running executions report: progress, outputs, results."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from skill_model import semantics
from skill_model.execution_state import ExecutionState
from skill_runtime.core.floor import Floor
from skill_runtime.core.ledger import Entry


class Reports:
    """Takes the reports of running executions; those of others come too late, which is no error.

    ``fail`` ends an execution as FAILED: one that reports what the model does not know.
    """

    def __init__(self, floor: Floor, fail: Callable[[str, str], bool]) -> None:
        self._floor = floor
        self._fail = fail

    def terminate(self, execution_id: str, result: str, message: str, outputs: Mapping[str, object]) -> bool:
        """End an execution with a result; False when it is not running (any more)."""
        floor = self._floor
        with floor.lock:
            entry = floor.ledger.running(execution_id)
            if entry is None:
                return False
            unknown = self._unknown_output(entry, outputs)
            if unknown:
                step = semantics.fail(floor.skillset, floor.ledger.situation, entry.key, unknown)
            else:
                entry.execution.outputs.update(outputs)
                step = semantics.terminate(floor.skillset, floor.ledger.situation, entry.key, result, message)
            stops = floor.ledger.commit(step, by_itself=entry)
        floor.after_step(stops)
        return True

    def set_outputs(self, execution_id: str, outputs: Mapping[str, object]) -> None:
        """Keep outputs; unknown names end the execution."""
        with self._floor.lock:
            entry = self._floor.ledger.running(execution_id)
            if entry is None:
                return
            unknown = self._unknown_output(entry, outputs)
            if not unknown:
                entry.execution.outputs.update(outputs)
        if unknown:
            self._fail(execution_id, unknown)

    def ask_progress(self, execution_id: str) -> float | None:
        """Ask the ``progress`` hook of an execution that is RUNNING, and keep its answer; return what is known then."""
        with self._floor.lock:
            entry = self._floor.ledger.running(execution_id)
            if entry is None:
                return None
            execution = entry.execution
            if entry.dispatching or entry.stop_hook or execution.state is not ExecutionState.RUNNING:
                return execution.progress
        answers: list[object] = []
        self._floor.call(entry, "progress", answers.append)
        if not answers or answers[0] is None:
            return None if execution.done else execution.progress
        return self.set_progress(execution_id, answers[0])

    def set_progress(self, execution_id: str, value: object) -> float | None:
        """Keep a progress, held within 0 to 1; what is no number ends the execution."""
        try:
            told = min(1.0, max(0.0, float(value)))  # type: ignore[arg-type]  # that is tried
        except (TypeError, ValueError) as error:
            self._fail(execution_id, f"progress raised {type(error).__name__}: {error}")
            return None
        with self._floor.lock:
            entry = self._floor.ledger.running(execution_id)
            if entry is None:
                return None
            if told != entry.execution.progress and entry.execution.state is ExecutionState.RUNNING:
                self._floor.ledger.progressed(entry)
            entry.execution.progress = told
        return told

    def _unknown_output(self, entry: Entry, outputs: Mapping[str, object]) -> str:
        """Return what is wrong with the names of outputs, or ""."""
        known = [output.name for output in self._floor.skillset.skill(entry.execution.skill).outputs]
        unknown = [name for name in outputs if name not in known]
        if not unknown:
            return ""
        return f"skill {entry.execution.skill} has no output {', '.join(unknown)}; it has {', '.join(known) or 'none'}"
