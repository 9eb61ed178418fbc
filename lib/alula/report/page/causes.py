"""Explain a run's failures: faults, how and why each skill failed, how the mission reacted.

The page shows it and judges nothing. While a run goes on, its live page is pushed what is made here; when it has ended, the report makes
it for the last time, shows it and writes it into ``summary.json``, where pages that are opened later read it.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterable, Mapping
from typing import Any

from alula.common.faults import DIED, FaultChange, FaultError, FaultRequest, parse_fault
from alula.common.record import EVENTS, MISSION, OPERATOR, TREE
from alula.common.scenarios import ScenarioError, load_scenario
from alula.records.causes.branches import Trees
from alula.records.causes.chains import Judgement, KnownFault, Scene, Step, chain_of, reaction_in, reacts_until_s
from alula.records.causes.effects import EffectsByFault
from alula.records.causes.failures import SkillFailure, skill_failures
from alula.records.causes.fault_file import effects_of_robot
from alula.records.causes.faults import Fault, faults_asked, faults_told, trace
from alula.records.causes.wording import end_text, fault_text, spoken
from alula.records.errors import AnalysisError
from alula.records.run import departure, lift_off_of, origin_of
from alula.report.page.entries import FAULT, HEALTH, NODES, RUN, SUMMARY, Wire
from alula.runtime.core.events import EngineEvent, TransitionEvent, read_event

HOLDING = {"pause": True, "paused": True, "resume": False, "abort": False}
"""Whether the mission is held after it has said so."""

Explanation = dict[str, Any]
"""``departed_s`` and ``back_s``, ``faults``, and ``failures`` with their chains of causes; seconds of mission clock."""

NOTHING: Explanation = {"departed_s": None, "back_s": None, "faults": [], "failures": []}
"""What a page is told that is told nothing."""


class Causes:
    """Collects the page's entries, and returns the explanation whenever it has changed."""

    def __init__(self) -> None:
        self._facts: dict[str, Any] = {}
        self._events: list[EngineEvent] = []
        self._mission: Mapping[str, Any] = {}
        self._trees = Trees()
        self._judgements: dict[str, list[Judgement]] = {}
        self._broken: list[FaultChange] = []
        self._held: list[tuple[float, float]] = []
        self._aborts: list[float] = []
        self._new = False
        self._told: Explanation = NOTHING
        self._summed: Explanation | None = None
        self._effects: EffectsByFault | None = None

    def take(self, entry: Wire) -> None:
        """Add an entry; ignore one that makes no sense."""
        topic, t_s, value = entry
        with contextlib.suppress(ValueError, TypeError, KeyError, IndexError, AttributeError):
            self._take(topic, -math.inf if t_s is None else t_s, value)

    def settle(self, explanation: object) -> None:
        """Take the explanation that the run's summary has; for an older summary, which has none, it is made of the entries."""
        self._summed = explanation if isinstance(explanation, dict) else None
        self._new = True

    def told(self) -> Explanation | None:
        """Return the explanation; None where it has not changed since the last call."""
        if not self._new:
            return None
        self._new = False
        told = self._tell() if self._summed is None else self._summed
        if told == self._told:
            return None
        self._told = told
        return told

    @property
    def explanation(self) -> Explanation:
        """The explanation that was returned last."""
        return self._told

    def _take(self, topic: str, t_s: float, value: Any) -> None:
        match topic:
            case _ if topic in {RUN, SUMMARY}:
                self._facts[topic] = value
            case _ if topic == EVENTS:
                self._events.append(read_event({**value, "stamp_s": max(t_s, 0.0)}))
            case _ if topic == MISSION:
                self._mission = value
            case _ if topic == TREE:
                self._trees.add(t_s, value)
            case _ if topic == NODES:
                self._trees.change(t_s, value)
            case _ if topic == HEALTH:
                found = Judgement(t_s, bool(value["ok"]), str(value.get("fault", "")), str(value.get("reason", "")))
                self._judgements.setdefault(str(value["sensor"]), []).append(found)
            case _ if topic == FAULT:
                self._broken.append(FaultChange(str(value["sensor"]), str(value["mode"]), t_s))
            case _ if topic == OPERATOR and value.get("by") == "mission" and value.get("command") in HOLDING:
                self._hold(t_s, str(value["command"]))
            case _:
                return
        self._new = True

    def _hold(self, t_s: float, command: str) -> None:
        is_held = bool(self._held) and math.isinf(self._held[-1][1])
        if HOLDING[command] and not is_held:
            self._held.append((t_s, math.inf))
        elif not HOLDING[command] and is_held:
            self._held[-1] = (self._held[-1][0], t_s)
        if command == "abort":
            self._aborts.append(t_s)

    # --- what follows from it ------------------------------------------------------------------------------------------

    def _tell(self) -> Explanation:
        events = sorted(self._events, key=lambda event: event.stamp_ns)
        failures = skill_failures(events)
        faults = self._faults(events)
        scene = Scene(events, self._trees, self._judgements, self._held, self._aborts, self._known_effects())
        return {
            "departed_s": self._departed_s(events),
            "back_s": _back_s(events),
            "faults": [{**_fault(one), "repair": self._repair(one.name)} for one in faults],
            "failures": [_failure(one, faults, scene, failures) for one in failures],
        }

    def _departed_s(self, events: list[EngineEvent]) -> float | None:
        said = self._mission.get("lift_off_s")
        return float(said) if isinstance(said, int | float) else lift_off_of(events, departure())

    def _known_effects(self) -> EffectsByFault:
        if self._effects is None:
            self._effects = EffectsByFault()
            with contextlib.suppress(AnalysisError):
                self._effects = effects_of_robot()
        return self._effects

    def _repair(self, fault: str) -> str:
        """Return the command that tells what could have been done about a fault; empty where none does.

        Faults are asked for as the robot's file has them, and missions that are files.
        """
        if fault not in self._known_effects().known:
            return ""
        try:
            mission = load_scenario(str((self._facts.get(RUN) or {}).get("scenario"))).mission
        except ScenarioError:
            return ""
        return f"alula repair {mission} --fault {fault}" if mission.endswith(".xml") else ""

    def _faults(self, events: list[EngineEvent]) -> list[KnownFault]:
        """Return what failed: as the summary tells; without one, what the recordings tell or what was asked for, traced."""
        summary = self._facts.get(SUMMARY) or {}
        if isinstance(answers := summary.get("answers"), list):
            lift_off = summary.get("lift_off") or {}
            departed_s = self._departed_s(events)
            zero_s = float(lift_off.get("stamp_s", origin_of(events, departure()) if departed_s is None else departed_s))
            found = [_summed(one, zero_s) for one in answers if isinstance(one.get("t_s"), int | float)]
        else:
            found = self._traced(events)
        return sorted(found, key=lambda one: one.at_s)

    def _traced(self, events: list[EngineEvent]) -> list[KnownFault]:
        effects = self._known_effects()
        told = faults_told(self._broken, effects)
        requests = [one for one in self._requests() if one.what not in {change.sensor for change, _ in told}]
        asked = faults_asked(requests, events, self._departed_s(events), effects)
        known = [*told, *((FaultChange(request.what, request.how, fault.at_s), fault) for request, fault in asked)]
        known.sort(key=lambda one: one[1].at_s)
        found = trace([fault for _, fault in known], events)
        return [
            KnownFault(
                name=change.sensor,
                mode=change.mode,
                at_s=fault.at_s,
                until_s=_until_s(fault, events),
                text=fault_text(change.sensor, change.mode, injected=True),
                detected_s=traced.detected_s,
                detected_by=traced.detected_by,
                failed=frozenset(failure.end.id for failure in traced.failures),
            )
            for (change, fault), traced in zip(known, found, strict=True)
        ]

    def _requests(self) -> list[FaultRequest]:
        found = []
        for text in (self._facts.get(RUN) or {}).get("faults") or ():
            with contextlib.suppress(FaultError):
                found.append(parse_fault(str(text)))
        return found


def _back_s(events: Iterable[EngineEvent]) -> float | None:
    """Return when the robot came back to its state of departure for the last time; None: it has not, or is away again."""
    place = departure()
    changes = [one for one in events if isinstance(one, TransitionEvent) and place is not None and one.resource == place[0]]
    return changes[-1].stamp_s if changes and place is not None and changes[-1].to_state == place[1] else None


def _until_s(fault: Fault, events: list[EngineEvent]) -> float | None:
    """Return when a fault ended; None: it lasts."""
    return fault.until_s if events and fault.until_s <= events[-1].stamp_s else None


def _summed(answer: Mapping[str, Any], zero_s: float) -> KnownFault:
    """Read an entry of a summary's ``answers``; of older ones all but processes that died was injected."""
    mode, name = str(answer.get("mode", "")), str(answer.get("sensor", ""))
    injected = bool(answer.get("injected", mode != DIED))
    detected_s, until_s = answer.get("detected_s"), answer.get("until_s")
    return KnownFault(
        name=name,
        mode=mode,
        at_s=zero_s + float(answer["t_s"]),
        until_s=None if until_s is None else zero_s + float(until_s),
        text=fault_text(name, mode, injected=injected),
        injected=injected,
        detected_s=None if detected_s is None else zero_s + float(detected_s),
        detected_by=str(answer.get("detected_by", "")),
        answered_by=str(answer.get("answered_by", "")),
        failed=frozenset(map(str, answer.get("failed") or ())),
    )


def _fault(fault: KnownFault) -> dict[str, Any]:
    """Return a fault as the page shows it; ``began`` and ``ended`` are sentences, None where something else tells of it."""
    way = f" ({fault.mode})" if "," in fault.text else ""
    began = None if not fault.injected and fault.mode == DIED else "was lost" if not fault.injected else f"was made to fail{way}"
    return {
        "name": fault.name,
        "text": fault.text,
        "mark": f"{fault.name} {'fails' if fault.injected else 'died' if fault.mode == DIED else 'lost'}",
        "began": began and f"The {spoken(fault.name)} {began}.",
        "ended": f"The {spoken(fault.name)} works again.",
        "t": fault.at_s,
        "until": fault.until_s,
        "detected": fault.detected_s,
        "resource": fault.detected_by.partition(" ")[0] if " -> " in fault.detected_by else "",
    }


def _failure(failure: SkillFailure, faults: list[KnownFault], scene: Scene, failures: list[SkillFailure]) -> dict[str, Any]:
    """Return a failure as the page shows it; ``fault``: the index of the fault behind it."""
    end = failure.end
    behind = next((at for at, fault in enumerate(faults) if end.id in fault.failed), None)
    chain = chain_of(failure, None if behind is None else faults[behind], scene, failures)
    reaction = reaction_in(chain)
    until_s = reacts_until_s(end.stamp_s, scene)
    return {
        "key": f"{end.skillset}/{end.skill}/{end.id}",
        "skill": end.skill,
        "t": end.stamp_s,
        "text": end_text(end),
        "fault": behind,
        "chain": [_step(one) for one in chain],
        "reacts_until": until_s if math.isfinite(until_s) else None,
        "reaction": None if reaction is None else {"t": reaction[0], "text": reaction[1]},
    }


def _step(step: Step) -> dict[str, Any]:
    return {"step": step.step, "t": step.t_s, "text": step.text}
