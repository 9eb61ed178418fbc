"""`./alula panel`: show running skillsets and control them manually.

Ends with 0, and with 2 when what was asked for can't be.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from alula.cli.options.live import DOMAINS
from alula.cli.table import parser_of
from alula.common.errors import AlulaError
from alula.common.runs import Run, deployments_up, find_deployment, find_run, is_deployment, live_runs
from skill_panel.memory import Memory
from skill_panel.watcher import Watcher, all_found, skillsets_in
from skillset_ros2.session import Session

LIST_S = 10.0
"""How long (wall clock) a domain that seems empty is looked into. What announces a new participant of DDS to the others may be lost; Fast
DDS announces each again after three seconds, so that this is time for three more."""


@dataclass(frozen=True)
class Place:
    """Where to look: a DDS domain, a namespace there (empty: all), and how it is called on the screen."""

    domain: int
    title: str
    namespace: str = ""


def parse(arguments: Sequence[str] | None) -> argparse.Namespace:
    """Return the command line's values; wrong ones print the usage on stderr and exit with code 2."""
    parser = parser_of("panel")
    options: argparse.Namespace = parser.parse_args(arguments)
    if options.domain is not None and options.domain not in DOMAINS:
        parser.error(f"--domain {options.domain}: a DDS domain is a number from 0 to {DOMAINS[-1]}")
    return options


def place_of(options: argparse.Namespace) -> Place:
    """Return where to look; raise NoRunError."""
    if options.run is not None:
        return _of_run(find_run(options.run))
    if options.on is not None:
        return _of_run(find_deployment(options.on))
    if options.domain is not None:
        return Place(options.domain, f"in DDS domain {options.domain}", options.namespace)
    own = os.environ.get("ROS_DOMAIN_ID", "")
    runs = [] if own.isdigit() else [*live_runs(), *deployments_up()]
    if runs:
        return _of_run(runs[0])
    domain = int(own) if own.isdigit() else 0
    return Place(domain, f"in DDS domain {domain}", options.namespace)


def _of_run(run: Run) -> Place:
    where = f"DDS domain {run.domain}, {run.namespace}" if run.namespace else f"DDS domain {run.domain}"
    if is_deployment(run.folder):
        return Place(run.domain, f"on {run.folder.name} ({where})", run.namespace)
    return Place(run.domain, f"in the run {run.folder.name} ({where})", run.namespace)


def say_what_runs(options: argparse.Namespace) -> None:
    """Print the skillsets of every run under way, and of the domain that would be looked into."""
    for place in dict.fromkeys([place_of(options), *(_of_run(run) for run in live_runs())]):
        session = Session("skill_panel", domain=place.domain)
        try:
            look = partial(skillsets_in, session.node, place.namespace, options.skillsets)
            found = [f"{space}/{name}" for space, name in sorted(all_found(look, LIST_S))]
        finally:
            session.close()
        sys.stdout.write(f"{place.title}: {', '.join(found) or 'no skillset'}\n")


def others_than(place: Place) -> list[str]:
    """Return a line for each run under way elsewhere."""
    return [
        f"A run is under way: ./alula panel --run {run.folder}"
        for run in live_runs()
        if (run.domain, run.namespace) != (place.domain, place.namespace)
    ]


def main(arguments: Sequence[str] | None = None) -> int:
    """Show the panel until it is left; return the exit code."""
    options = parse(arguments)
    try:
        place = place_of(options)
    except AlulaError as error:
        sys.stderr.write(f"alula panel: {error}\n")
        return 2
    if options.list:
        say_what_runs(options)
        return 0
    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        sys.stderr.write("alula panel: needs a terminal; --list prints what runs without one\n")
        return 2
    from skill_panel.app import Panel

    watcher = Watcher(domain=place.domain, namespace=place.namespace, names=options.skillsets)
    try:
        state = os.environ.get("ALULA_ROBOT_STATE", "")
        memory = Memory(Path(state) / "panel.json" if state else None)
        Panel(watcher, where=place.title, others=others_than(place), memory=memory).run()
    finally:
        watcher.close()
    return 0


if __name__ == "__main__":
    sys.exit(main())
