"""An answer as text and as JSON."""

from __future__ import annotations

from collections.abc import Sequence

from alula.odds.odds import Odds
from alula.odds.rendering import WORDS
from alula.repair import planning
from alula.repair.branches import Branch
from alula.repair.fates import Fate
from alula.repair.repairing import Answer, Repair
from alula.trees.view import NodeView

Both = tuple[Odds, Odds]
"""The odds without the branch, and with it."""


def as_text(answer: Answer, odds: Both | None) -> str:
    """Return an answer as lines for a terminal."""
    what = "; ".join(dict.fromkeys(one.words for one in answer.failing))
    if answer.survives_already:
        often = f", as often as it may come (`--most-faults {answer.strikes}`)" if answer.strikes else ""
        return f"nothing to repair: {what}, and the mission survives it{often}{_assuming(answer.assuming)}\n"
    if answer.repair is None:
        when = " before the search was ended" if answer.stopped else ""
        head = "impossible" if answer.impossible else f"unknown: no branch was proved{when}"
        lines = [f"{head}: {what} ({answer.tried} branches tried)", *(f"  {one}" for one in answer.reasons)]
        return "\n".join(lines) + "\n"
    return "\n".join(_of_repair(answer.repair, what, odds, answer.reasons)) + "\n"


def _of_repair(repair: Repair, what: str, odds: Both | None, reasons: Sequence[str]) -> list[str]:
    branch = repair.branch
    where = "around" if branch.around else "in a Fallback around" if branch.wraps else "behind"
    lines = [f"repaired, proved by check: {what}", f"  '{branch.name}', {branch.size} nodes, {where} the node at {branch.at}"]
    lines += [f"  it can't be accomplished then, and ends safely: {one}" for one in reasons]
    lines += [f"  it survives{_assuming(repair.assuming)}; else it ends safely"] if repair.assuming else []
    lines += ["", text, ""] if (text := branch.as_xml()) else []
    lines += [f"  not proved: the property `{one}` asks for a node that the mission has not" for one in repair.not_asked]
    lines += [f"  left as it was: {one}" for one in repair.left]
    for faults, after in repair.after.items():
        before = repair.before[faults]
        if len(faults) == 1 or after.answered or not after.safe:
            lines.append(f"  {' and then '.join(faults):<34} {_fate(before)} -> {_fate(after)}")
    if repair.not_looked_at:
        lines.append(f"  not looked at: {', '.join(' and then '.join(one) for one in repair.not_looked_at)}")
    if odds is not None:
        lines.append("odds, without and with it:")
        lines += [f"  {WORDS[name]:<18} {_range(odds[0], name)} -> {_range(odds[1], name)}" for name in odds[0].outcomes]
    return lines


def as_dict(answer: Answer, odds: Both | None) -> dict[str, object]:
    """Return an answer in the form of `--json`."""
    repair = answer.repair
    kind = "nothing to repair" if answer.survives_already else "repaired" if repair else "impossible" if answer.impossible else "unknown"
    found: dict[str, object] = {
        "answer": kind,
        "failing": [{"skill": one.skill, "node": one.leaf.name, "fault": one.fault} for one in answer.failing],
        "tried": answer.tried,
        "stopped": answer.stopped,
        "reasons": list(answer.reasons),
        "assuming": list(answer.assuming),
        "refused": [one.as_dict() for one in answer.refused],
    }
    if repair is None:
        return found
    places = {"file": repair.branch.at.path, "line": repair.branch.at.line, "column": repair.branch.at.column}
    branch = {
        "name": repair.branch.name,
        "nodes": repair.branch.size,
        "at": places,
        "wraps": repair.branch.wraps,
        "around": repair.branch.around,
    }
    found["repair"] = {**branch, "xml": repair.branch.as_xml(), "use": "".join(repair.branch.use.pieces())}
    found["not_asked"] = list(repair.not_asked)
    found["left"] = list(repair.left)
    found["not_looked_at"] = [list(one) for one in repair.not_looked_at]
    found["fates"] = [{"before": repair.before[one].as_dict(), "after": fate.as_dict()} for one, fate in repair.after.items()]
    if odds is not None:
        found["odds"] = {name: _pairs(odds, name) for name in odds[0].outcomes}
    return found


def added(view: NodeView, branch: Branch) -> frozenset[int]:
    """Return the numbers of a branch's nodes in a drawn mission."""
    found: set[int] = set()

    def visit(one: NodeView, number: int, *, new: bool) -> int:
        new = new or (one.name == branch.name and not branch.around)
        outer = one.name == branch.name or (branch.wraps and any(child.name == branch.name for child in one.children))
        if new or outer:
            found.add(number)
        number += 1
        for child in one.children:
            number = visit(child, number, new=new)
        return number

    visit(view, 0, new=False)
    return frozenset(found)


def _pairs(odds: Sequence[Odds], name: str) -> dict[str, list[float]]:
    words = ("before", "after")
    return {word: [one.outcomes[name].least.value, one.outcomes[name].most.value] for word, one in zip(words, odds, strict=True)}


def _range(odds: Odds, name: str) -> str:
    one = odds.outcomes[name]
    return f"{one.least.value:.6g} to {one.most.value:.6g}"


def _fate(fate: Fate) -> str:
    return f"survives{_assuming(fate.assuming)}" if fate.answered else "ends safely" if fate.safe else "unsafe"


def _assuming(assuming: Sequence[str]) -> str:
    states = [one.rpartition(" ") for one in assuming]
    return f" assuming that {' and '.join(f'{at} does not become {state} later' for at, _, state in states)}" if states else ""


# --- plans --------------------------------------------------------------------------------------------------------------


def plan_as_text(answer: planning.Answer) -> str:
    """Return a plan as lines for a terminal."""
    if answer.plan is None:
        when = " before the search was ended" if answer.stopped else ""
        head = "impossible" if answer.impossible else f"unknown: no course of skills was proved{when} ({answer.tried} tried)"
        return "\n".join([head, *(f"  {one}" for one in answer.reasons)]) + "\n"
    plan = answer.plan
    lines = [f"planned, proved by check: {', then '.join(plan.steps)}; {plan.nodes} nodes", "", plan.text]
    lines += [f"  {fault:<34} {_fate(fate)}" for fault, fate in plan.fates.items()]
    if plan.left_out:
        lines.append(f"  not looked at: {', '.join(plan.left_out)}")
    return "\n".join(lines) + "\n"


def plan_as_dict(answer: planning.Answer) -> dict[str, object]:
    """Return a plan in the form of `--json`."""
    kind = "planned" if answer.plan else "impossible" if answer.impossible else "unknown"
    found: dict[str, object] = {
        "answer": kind,
        "tried": answer.tried,
        "stopped": answer.stopped,
        "reasons": list(answer.reasons),
        "refused": [one.as_dict() for one in answer.refused],
    }
    if answer.plan is None:
        return found
    plan = answer.plan
    found["plan"] = {"xml": plan.text, "steps": list(plan.steps), "nodes": plan.nodes}
    found["not_looked_at"] = list(plan.left_out)
    found["fates"] = [one.as_dict() for one in plan.fates.values()]
    return found
