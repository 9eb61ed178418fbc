"""Manual control: the skillsets of a run under way, found by their description, shown as JSON and called; what `./alula panel` can."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from alula.common.plain import to_plain
from alula.console.form import Field, FormError, fields, values
from alula.console.link import ActError, Skillset, Skillsets
from alula.model.execution_state import ExecutionState
from alula.runtime.core.errors import SkillRuntimeError

if TYPE_CHECKING:
    from alula.console.view import ResourceRow, SkillRow, SkillsetView
    from alula.runtime.core.records import ExecutionRecord
    from alula.runtime.handle import SkillHandle

ANSWER_S = 5.0
"""How long (wall clock) managers may take to answer."""
MAX_TEXT = 2000
QUESTIONS = frozenset({"why"})
"""Acts that change nothing."""


class ManualControl:
    """Starts, stops and inspects skills of a run without its mission, until it is closed; all methods may be called from any thread."""

    def __init__(self, skillsets: Skillsets) -> None:
        self._skillsets = skillsets
        self._acts: Mapping[str, Callable[[Skillset, Mapping[str, Any]], str]] = {
            "start": self._start,
            "interrupt": self._interrupt,
            "pause": lambda one, asked: self._set_paused(one, asked, paused=True),
            "resume": lambda one, asked: self._set_paused(one, asked, paused=False),
            "why": self._why,
            "transition": self._transition,
        }

    def close(self) -> None:
        """Stop listening; skills that run keep running."""
        self._skillsets.close()

    # --- what is shown -------------------------------------------------------------------------------------------------

    def describe(self) -> dict[str, Any]:
        """Return what is known now: ``{problems, skillsets: [{root, alive, skills, resources, data}]}``; ages in seconds."""
        shown = [self._skillset(one, one.view) for one in self._skillsets.watched if one.view is not None]
        return {"problems": self._skillsets.problems, "skillsets": shown}

    def _skillset(self, one: Skillset, view: SkillsetView) -> dict[str, Any]:
        records = one.client.skills
        ends = {name: record.last for name, record in records.items()}
        return {
            "root": one.root,
            "alive": view.alive,
            "skills": [_skill(row, ends.get(row.name), _fields(one, row.name)) for row in view.skill_rows()],
            "resources": [_resource(row) for row in view.resource_rows()],
            "data": [
                {"name": row.name, "value": row.value, "age_s": None if row.age_s is None else round(row.age_s, 1), "stale": row.stale}
                for row in view.data_rows(self._skillsets.now_ns)
            ],
        }

    # --- what is done --------------------------------------------------------------------------------------------------

    def do(self, asked: Mapping[str, Any]) -> tuple[str, str]:
        """Execute a request: ``{act, root, skill, texts}`` or ``{act: "transition", root, resource, to}``.

        Waits for the managers' answer; returns what was done in words, and the answer.

        Raises:
            ActError: the request is malformed, or the managers do not answer.
        """
        act, root = asked.get("act"), asked.get("root")
        one = next((one for one in self._skillsets.watched if one.root == root), None)
        if one is None:
            raise ActError(f"there is no skillset {root} in this run; there are {', '.join(one.root for one in self._skillsets.watched)}")
        if not isinstance(act, str) or act not in self._acts:
            raise ActError(f"there is no act {act}; there are {', '.join(self._acts)}")
        try:
            answer = self._acts[act](one, asked)
        except (FormError, ValueError, SkillRuntimeError) as error:
            raise ActError(str(error)) from error
        return _words(act, one, asked), answer

    def _start(self, one: Skillset, asked: Mapping[str, Any]) -> str:
        skill = _skill_name(one, asked)
        handle = one.start(skill, _inputs(one, skill, asked))
        _wait_for_first_news(handle)
        if not handle.done:
            return f"{skill} is {handle.state.value}"
        return " ".join(word for word in (handle.outcome, handle.result, handle.message) if word)

    def _interrupt(self, one: Skillset, asked: Mapping[str, Any]) -> str:
        count = one.client.interrupt_all(_skill_name(one, asked)).get(ANSWER_S)
        return f"{count} execution{'' if count == 1 else 's'} told to end" if count else "nothing runs of it"

    def _set_paused(self, one: Skillset, asked: Mapping[str, Any], *, paused: bool) -> str:
        skill = _skill_name(one, asked)
        open_ones = one.client.skills[skill].open if skill in one.client.skills else ()
        answers = [one.client.set_paused(execution.id, paused).get(ANSWER_S) for execution in open_ones]
        return "; ".join(answer or ("paused" if paused else "goes on") for answer in answers) or "nothing runs of it"

    def _why(self, one: Skillset, asked: Mapping[str, Any]) -> str:
        skill = _skill_name(one, asked)
        why = one.client.why(skill, _inputs(one, skill, asked)).get(ANSWER_S)
        past = [f"{change.stamp_ns / 1e9:.2f} s {change.resource} → {change.to_state} by {change.cause}" for change in why.history]
        return "; ".join(["it could start now" if why.ready else why.reason or why.refusal, *past[-3:]])

    def _transition(self, one: Skillset, asked: Mapping[str, Any]) -> str:
        resource, to = str(asked.get("resource")), str(asked.get("to"))
        answer = one.client.transition(resource, to).get(ANSWER_S)
        return f"{resource} is {answer.state or to}" if answer.accepted else f"refused: {answer.reason}"


# --- inside ------------------------------------------------------------------------------------------------------------


def _skill(row: SkillRow, last: ExecutionRecord | None, inputs: list[Field]) -> dict[str, Any]:
    return {
        "name": row.name,
        "status": row.status,
        "unmet": list(row.unmet),
        "running": [{"id": one.id, "state": one.state, "progress": one.progress} for one in row.running],
        "last": None if last is None else _end(last),
        "inputs": [{"name": field.name, "kind": field.kind, "said": field.said, "text": field.text} for field in inputs],
    }


def _end(last: ExecutionRecord) -> dict[str, Any]:
    end = {
        "state": last.state.value,
        "result": last.result,
        "message": last.message,
        "t_s": None if last.ended_s is None else round(last.ended_s, 3),
    }
    return {**end, "inputs": to_plain(last.inputs), "outputs": to_plain(last.outputs)}


def _resource(row: ResourceRow) -> dict[str, Any]:
    targets = {"targets": list(row.targets), "every_target": list(row.every_target)}
    return {"name": row.name, "state": row.state, "reason": row.reason, **targets}


def _fields(one: Skillset, skill: str) -> list[Field]:
    return fields(one.client.model.skill(skill), one.client.input_types(skill), {})


def _skill_name(one: Skillset, asked: Mapping[str, Any]) -> str:
    name = asked.get("skill")
    known = [skill.name for skill in one.client.model.skills]
    if name not in known:
        raise ActError(f"{one.root} has no skill {name}; it has {', '.join(known)}")
    return str(name)


def _inputs(one: Skillset, skill: str, asked: Mapping[str, Any]) -> dict[str, object]:
    """Return the values that the texts of a form mean; raise FormError and ActError."""
    texts, made = asked.get("texts"), _fields(one, skill)
    if not isinstance(texts, dict) or not all(isinstance(texts.get(field.name), str) for field in made):
        raise ActError(f"{skill} takes {', '.join(field.label for field in made) or 'no inputs'}, each as a text")
    if any(len(texts[field.name]) > MAX_TEXT for field in made):
        raise ActError(f"an input of {skill} is longer than {MAX_TEXT} characters")
    return values(made, texts)


def _wait_for_first_news(handle: SkillHandle) -> None:
    """Wait until an execution runs, is refused, or has been silent for some seconds."""
    news = threading.Event()
    handle.on_report(lambda report: news.set() if report.state is not ExecutionState.REQUESTED else None)
    handle.add_done_callback(lambda _: news.set())
    if handle.state is ExecutionState.REQUESTED:
        news.wait(ANSWER_S)


def _words(act: str, one: Skillset, asked: Mapping[str, Any]) -> str:
    """Return an act as the record names it, as ``start navigation.hover duration 2.0``."""
    root = one.root.strip("/").replace("/", ".")
    if act == "transition":
        return f"transition {root}.{asked.get('resource')} to {asked.get('to')}"
    texts = [(field.name, asked["texts"][field.name]) for field in _fields(one, str(asked.get("skill")))] if act == "start" else []
    inputs = [f"{name} {json.dumps(text) if ' ' in text else text}" for name, text in texts]
    return ", ".join([f"{act} {root}.{asked.get('skill')}", *inputs])
