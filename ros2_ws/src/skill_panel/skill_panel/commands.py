"""`./alula skills | start | interrupt | events | why | transition | data`: running skillsets, driven from a shell.

Ends with 0 when what was asked for came to pass, 1 when it did not (another outcome than TERMINATED, not ready, refused, stale),
2 when it can't be asked for. Results go to stdout, as text or JSON.
"""

from __future__ import annotations

import argparse
import json
import sys
import threading
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

from alula.cli.table import parser_of
from alula.common.errors import AlulaError
from alula.common.record import EVENTS, FILE, RecordFollower
from alula.common.runs import LATEST, find_run, load_run
from alula.common.signals import Interrupts, on_end_signal
from alula.common.suggestions import nearest, with_nearest
from alula.runtime.core.events import event_record
from skill_panel.__main__ import LIST_S, Place, place_of
from skill_panel.watcher import all_found, skillsets_in

DONE, NOT_DONE, WRONG = 0, 1, 2
ANSWER_S = 10.0
"""Wall clock, for an answer of managers that are there."""
LOOK_S = 0.2
MORE_S = 3.0
"""Wall clock, for skillsets that the graph tells of after others."""
Clients = Mapping[str, Any]
"""The generic client of each skillset (of any middleware) by the skillset's name."""
Out = Callable[[object, str], None]
"""Takes a result as JSON has it, and as text."""


class CommandError(Exception):
    """What was asked for can't be; the message names it and what there is."""


class NotThereError(CommandError):
    """What was named belongs to no skillset that is known so far."""


def find_skill(clients: Clients, name: str) -> tuple[Any, str]:
    """Return the client and the name of ``skill`` or ``skillset.skill``; raise CommandError."""
    skillset, _, skill = name.rpartition(".")
    found = [c for n, c in clients.items() if skillset in {"", n} and skill in {s.name for s in c.model.skills}]
    if len(found) == 1:
        return found[0], skill
    known = [f"{n}.{s.name}" for n, c in clients.items() for s in c.model.skills]
    if found:
        raise CommandError(f"several skillsets have a skill {skill}; write {' or '.join(k for k in known if k.endswith(f'.{skill}'))}")
    raise NotThereError(with_nearest(f"there is no skill {name}", name, [*known, *(k.partition(".")[2] for k in known)]))


def find_member(clients: Clients, name: str, what: str) -> tuple[Any, str]:
    """Return the client and the name of ``skillset.member``; raise CommandError."""
    skillset, _, member = name.partition(".")
    if skillset not in clients or not member:
        kind = NotThereError if member else CommandError
        raise kind(f"there is no {what} {name}; write SKILLSET.NAME, skillsets: {', '.join(clients)}")
    return clients[skillset], member


def read_inputs(client: Any, skill: str, words: Sequence[str]) -> dict[str, object]:
    """Read ``key=value``; a value is YAML (``target=[1, 2, 3]``), a string input's is taken as it is; raise CommandError."""
    types = client.input_types(skill)
    inputs: dict[str, object] = {}
    for word in words:
        key, equals, text = word.partition("=")
        if not equals:
            raise CommandError(f"{word}: write an input as key=value; {skill} takes {', '.join(types) or 'none'}")
        if key not in types:
            raise CommandError(f"{skill} has no input {key}; {nearest(key, types) or 'it takes none'}")
        try:
            inputs[key] = text if types[key] == "string" else yaml.safe_load(text)
        except yaml.YAMLError:
            raise CommandError(f"{key}: {text!r} can't be read as {types[key]}") from None
    return inputs


def skills(clients: Clients, _: argparse.Namespace, out: Out) -> int:
    """List what the skillsets have and how it is."""
    for name, client in clients.items():
        known = {s.name: {"inputs": client.input_types(s.name), "open": len(client.skills[s.name].open)} for s in client.model.skills}
        named = [one.name for one in client.model.data]
        lines = [name]
        for skill, facts in known.items():
            taken = ", ".join(f"{key}: {kind}" for key, kind in facts["inputs"].items())
            lines.append(f"  {skill}({taken}){'  running' if facts['open'] else ''}")
        resources, reasons = client.resources, {resource: reason for resource, reason in client.reasons.items() if reason}
        because = {resource: f" ({reason})" for resource, reason in reasons.items()}
        lines += [f"  {resource} = {state}{because.get(resource, '')}" for resource, state in resources.items()]
        lines += [f"  data {one}" for one in named]
        out({"skillset": name, "skills": known, "resources": resources, "reasons": reasons, "data": named}, "\n".join(lines))
    return DONE


def start(clients: Clients, options: argparse.Namespace, out: Out) -> int:
    """Run a skill to its end; the first Ctrl-C interrupts it, the second leaves it alone."""
    client, skill = find_skill(clients, options.skill)
    handle = client.start(skill, **read_inputs(client, skill, options.inputs))
    interrupts = Interrupts(handle.interrupt, lambda: None)
    if threading.current_thread() is threading.main_thread():
        interrupts.install()
    while not handle.wait(LOOK_S) and not interrupts.at_once:
        pass
    ended = handle.ended
    if ended is None:
        raise CommandError(f"{skill} has not ended; it goes on without this command")
    out(
        {"skill": skill, "outcome": ended.outcome, "result": ended.result, "message": ended.message, "outputs": _plain(ended.outputs)},
        f"{skill}: {ended}" + "".join(f"\n  {key} = {value}" for key, value in _plain(ended.outputs).items()),
    )
    return DONE if ended.outcome == "TERMINATED" else NOT_DONE


def interrupt(clients: Clients, options: argparse.Namespace, out: Out) -> int:
    """Interrupt all executions of a skill."""
    client, skill = find_skill(clients, options.skill)
    count = client.interrupt_all(skill).get(ANSWER_S)
    out({"skill": skill, "interrupted": count}, f"{skill}: {count} interrupted")
    return DONE if count else NOT_DONE


def why(clients: Clients, options: argparse.Namespace, out: Out) -> int:
    """Say what keeps a skill from starting."""
    client, skill = find_skill(clients, options.skill)
    inputs = read_inputs(client, skill, options.inputs)
    answer = client.why(skill, inputs or None).get(ANSWER_S)
    unmet = [{"name": u.name, "condition": u.condition, "states": dict(u.states), "data": dict(u.data)} for u in answer.unmet]
    history = [f"  {e.stamp_ns / 1e9:.1f} s: {e.resource} {e.from_state} -> {e.to_state} ({e.cause})" for e in answer.history]
    out(
        {"skill": skill, "ready": answer.ready, "reason": answer.reason, "unmet": unmet},
        "\n".join([f"{skill}: {'ready' if answer.ready else answer.reason}", *([] if answer.ready else history)]),
    )
    return DONE if answer.ready else NOT_DONE


def transition(clients: Clients, options: argparse.Namespace, out: Out) -> int:
    """Take an extern transition, as the functional layer does."""
    client, resource = find_member(clients, options.resource, "resource")
    answer = client.transition(resource, options.state).get(ANSWER_S)
    words = f"{options.resource} = {answer.state}" if answer.accepted else f"refused: {answer.reason}"
    out({"resource": options.resource, "accepted": answer.accepted, "reason": answer.reason, "state": answer.state}, words)
    return DONE if answer.accepted else NOT_DONE


def data(clients: Clients, options: argparse.Namespace, out: Out) -> int:
    """Show one data, or all."""
    names = [options.data] if options.data else [f"{n}.{d.name}" for n, c in clients.items() for d in c.model.data]
    fresh = True
    for name in names:
        client, member = find_member(clients, name, "data")
        reading = client.read_data(member).get(ANSWER_S)
        fresh &= reading.received and not reading.stale
        stamp_s = reading.stamp_ns / 1e9 if reading.received else None
        age = ", stale" if reading.stale else ""
        words = "nothing received" if stamp_s is None else f"{json.dumps(reading.value)} at {stamp_s:.1f} s{age}"
        entry = {"data": name, "received": reading.received, "stale": reading.stale, "stamp_s": stamp_s, "value": reading.value}
        out(entry, f"{name}: {words}")
    return DONE if fresh else NOT_DONE


def events(clients: Clients, options: argparse.Namespace, out: Out) -> int:
    """Show every event from now on, until Ctrl-C."""
    over = threading.Event()
    if threading.current_thread() is threading.main_thread():
        on_end_signal(lambda _: over.set())
    forget = [c.on_event(lambda event: _tell(event_record(event), out)) for n, c in clients.items() if options.skillset in {None, n}]
    while not over.wait(LOOK_S):
        pass
    for stop in forget:
        stop()
    return DONE


def recorded_events(folder: Path, options: argparse.Namespace, out: Out) -> int:
    """Show the events that a run has recorded so far."""
    for entry in RecordFollower(folder / FILE).poll():
        if entry.topic == EVENTS and options.skillset in {None, entry.value["skillset"]}:
            _tell(entry.value, out)
    return DONE


def _tell(record: Mapping[str, Any], out: Out) -> None:
    stamp = f"{record['stamp_s']:8.2f} s  {record['skillset']}."
    if record["kind"] == "TRANSITION":
        text = f"{stamp}{record['resource']}: {record['from_state']} -> {record['to_state']} ({record['cause']})"
    else:
        end = ": ".join(part for part in (record["result"], record["message"]) if part)
        text = f"{stamp}{record['skill']}: {record['state']}{f' ({end})' if end else ''}"
    out(record, text)


def _plain(outputs: object) -> dict[str, object]:
    return {str(key): value for key, value in outputs.items()} if isinstance(outputs, Mapping) else {}


COMMANDS: dict[str, Callable[[Clients, argparse.Namespace, Out], int]] = {
    "skills": skills,
    "start": start,
    "interrupt": interrupt,
    "events": events,
    "why": why,
    "transition": transition,
    "data": data,
}


def parse(arguments: Sequence[str]) -> argparse.Namespace:
    """Read the command line, whose first word names the command; exits with 2 when it is wrong."""
    name, *words = arguments
    options = parser_of(name).parse_args(words)
    options.command = name
    return options


def write(value: object, text: str, *, as_json: bool) -> None:
    """Write one result to stdout, at once."""
    sys.stdout.write(f"{json.dumps(value, default=str) if as_json else text}\n")
    sys.stdout.flush()


def drive(options: argparse.Namespace, out: Out) -> int:
    """Connect to the skillsets and do the command."""
    # Late: a wrong command line needs no middleware.
    from skillset_ros2.robot import Robot
    from skillset_ros2.session import Session

    place = place_of(options)
    session = Session("alula", domain=place.domain)
    try:
        found: list[tuple[str, str]] = []
        starts = "alula run SCENARIO, alula up DEPLOYMENT or alula mock"
        problem = CommandError(f"no skillset was found {place.title} within {LIST_S:g} s; {starts} starts some")
        # What is not there may belong to a skillset that the graph has not told of yet.
        while more := _other_skillsets(session.node, place, found):
            found += more
            names = sorted(name for _, name in found)
            robot = Robot(session.node, names, namespace=_one_namespace(found, place))
            try:
                if not robot.wait_ready(ANSWER_S):
                    raise CommandError(f"the managers of {', '.join(names)} do not answer {place.title}")
                return COMMANDS[options.command](robot.clients, options, out)
            except NotThereError as error:
                problem = error
            finally:
                robot.close()
        raise problem
    finally:
        session.close()


def _other_skillsets(node: Any, place: Place, known: Sequence[tuple[str, str]]) -> list[tuple[str, str]]:
    """Return namespace and name of the skillsets that are not known yet, as soon as there are some and the graph tells of no more."""
    within_s = MORE_S if known else LIST_S
    return all_found(lambda: [one for one in skillsets_in(node, place.namespace) if one not in known], within_s)


def _one_namespace(found: Sequence[tuple[str, str]], place: Place) -> str:
    """Return the namespace of all; raise CommandError where there are several."""
    spaces = sorted({space for space, _ in found})
    if len(spaces) > 1:
        raise CommandError(f"{len(spaces)} robots run {place.title}: say which by --namespace: {', '.join(one or '/' for one in spaces)}")
    return spaces[0]


def main(arguments: Sequence[str] | None = None) -> int:
    """Do the command that the first word names; return the exit code."""
    options = parse(sys.argv[1:] if arguments is None else arguments)

    def out(value: object, text: str) -> None:
        write(value, text, as_json=options.json)

    try:
        if options.command == "events" and not options.follow:
            folder = find_run(LATEST).folder if options.run in {None, LATEST} else load_run(Path(options.run)).folder
            return recorded_events(folder, options, out)
        return drive(options, out)
    except (CommandError, AlulaError, ValueError) as error:
        sys.stderr.write(f"alula {options.command}: {error}\n")
        return WRONG


if __name__ == "__main__":
    sys.exit(main())
