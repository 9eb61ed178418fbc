"""What the commands that talk to a running robot take, or serve one."""

from __future__ import annotations

from argparse import ArgumentParser
from collections.abc import Callable
from pathlib import Path
from typing import Any

from alula.cli.options.runs import FAULT
from alula.cli.parser import completed_by, json_option

DOMAINS = range(233)
LATEST = "latest"
PORT = 8440


def console(parser: ArgumentParser) -> None:
    """Add what ``alula console`` takes."""
    which = parser.add_mutually_exclusive_group()
    which.add_argument("--run", metavar="DIR|latest", default=LATEST, help="show this run's folder first (default: the newest)")
    which.add_argument("--domain", type=int, metavar="N", help="show the run under way in this DDS domain first")
    on = which.add_argument("--on", metavar="DEPLOYMENT", help="show this deployment first; it has to be up here")
    completed_by(on, "deployments")
    parser.add_argument(
        "--beside", type=Path, action="append", default=[], metavar="DIR", help="show the runs of the robot in this folder, too; repeatable"
    )
    parser.add_argument(
        "--host",
        default="127.0.0.1",
        help="address to listen on (default 127.0.0.1); any other is served over TLS, and viewers need the printed URL",
    )
    parser.add_argument(
        "--certificate", type=Path, metavar="FILE", help="TLS certificate, PEM (default for other addresses: a self-signed one)"
    )
    parser.add_argument("--key", type=Path, metavar="FILE", help="its private key, PEM, without a passphrase")
    parser.add_argument("--plain", action="store_true", help="with --host: serve without TLS; other machines may then only watch")
    parser.add_argument("--port", type=int, help=f"listen on this port (default {PORT}, or a free one where that is taken)")


def panel(parser: ArgumentParser) -> None:
    """Add what ``alula panel`` takes."""
    completed_by(parser.add_argument("skillsets", nargs="*", metavar="SKILLSET", help="show only these"), "skillsets")
    parser.add_argument("--namespace", default="", metavar="NS", help="show only the robot in this namespace, such as /robot1")
    place = parser.add_mutually_exclusive_group()
    place.add_argument("--run", metavar="DIR|latest", help="the run of this folder, or the newest one under way")
    _on(place)
    place.add_argument("--domain", type=int, metavar="N", help="the skillsets in this DDS domain")
    parser.add_argument("--list", action="store_true", help="list the runs under way on this machine, and exit")


def _on(place: Any) -> None:
    """Add the name of a deployment that is up."""
    completed_by(
        place.add_argument("--on", metavar="DEPLOYMENT", help="the skillsets of this deployment; it has to be up here"), "deployments"
    )


def mocks(parser: ArgumentParser) -> None:
    """Add what every program that mocks skillsets takes."""
    parser.add_argument(
        "--behaviour", action="append", default=[], type=Path, metavar="FILE", help="behaviour file, on top of the robot's own"
    )
    fail = parser.add_argument("--fail", action="append", default=[], metavar=FAULT, help="inject a fault that the behaviour file declares")
    completed_by(fail, "faults")
    parser.add_argument("--seed", type=int, default=0, help="seed of the mocks' random choices (default 0)")
    parser.add_argument("--starter", action="store_true", help="print a behaviour file to start from, and exit")


def mock(parser: ArgumentParser) -> None:
    """Add what ``alula mock`` takes."""
    models = "a folder of models, bindings, and mock.yaml if there is one (default: the robot's)"
    parser.add_argument("robot", type=Path, nargs="?", metavar="FOLDER", help=models)
    skillset = parser.add_argument(
        "--skillset", action="append", default=[], metavar="NAME", help="mock only this skillset of the robot; repeatable"
    )
    completed_by(skillset, "skillsets")
    mocks(parser)


def talking(*own: Callable[[ArgumentParser], None]) -> Callable[[ArgumentParser], None]:
    """Return what adds a command's own arguments, and those of all commands that talk to running skillsets."""

    def add(parser: ArgumentParser) -> None:
        for one in own:
            one(parser)
        place = parser.add_mutually_exclusive_group()
        place.add_argument("--run", metavar="DIR|latest", help="the run of this folder, or the newest one under way")
        _on(place)
        domain = place.add_argument("--domain", type=int, choices=DOMAINS, metavar="N", help="the skillsets in this DDS domain")
        completed_by(domain, "nothing")
        parser.add_argument("--namespace", default="", metavar="NS", help="only the robot in this namespace")
        json_option(parser, "each result")

    return add


def deployed(parser: ArgumentParser) -> None:
    """Add the name of a deployment that may be left out where the robot has only one."""
    completed_by(parser.add_argument("deployment", nargs="?", metavar="DEPLOYMENT", help="name in deployments/"), "deployments")


def up(parser: ArgumentParser) -> None:
    """Add what ``alula up`` takes."""
    completed_by(parser.add_argument("deployment", metavar="DEPLOYMENT", help="name in deployments/"), "deployments")
    parser.add_argument("--restart", action="append", default=[], metavar="PART", help="restart this part; repeatable")


def down(parser: ArgumentParser) -> None:
    """Add what ``alula down`` takes."""
    deployed(parser)
    parser.add_argument("--now", action="store_true", help="end them also while a mission runs")


def status(parser: ArgumentParser) -> None:
    """Add what ``alula status`` takes."""
    deployed(parser)
    json_option(parser, "the state of its parts")


def doctor(parser: ArgumentParser) -> None:
    """Add what ``alula doctor`` takes."""
    words = "examine this deployment on what runs, instead of the installation: names, master, nodes, bindings, ROS 2, clocks, disk"
    completed_by(parser.add_argument("deployment", nargs="?", metavar="DEPLOYMENT", help=words), "deployments")
    json_option(parser, "what was found of a deployment")


def service(parser: ArgumentParser) -> None:
    """Add what ``alula service`` takes."""
    words = parser.add_argument("words", nargs="+", metavar="[install|remove] DEPLOYMENT", help="what to do, and with which deployment")
    completed_by(words, "deployments")
    parser.add_argument("--print", dest="told", action="store_true", help="print the unit, and change nothing")
    parser.add_argument("--system", action="store_true", help="a unit of the system, which starts at boot (default: of the user)")


def skill(parser: ArgumentParser) -> None:
    """Add the name of a skill."""
    completed_by(parser.add_argument("skill", metavar="SKILL", help="a skill, such as drive or base.drive"), "skills")


def inputs(parser: ArgumentParser) -> None:
    """Add a skill's inputs."""
    values = parser.add_argument("inputs", nargs="*", metavar="key=value", help="inputs of the skill; values as in YAML")
    completed_by(values, "inputs")


def state(parser: ArgumentParser) -> None:
    """Add a resource and its state."""
    completed_by(parser.add_argument("resource", metavar="SKILLSET.RESOURCE", help="a resource of a skillset"), "resources")
    completed_by(parser.add_argument("state", metavar="STATE", help="the state to change to"), "states")


def data(parser: ArgumentParser) -> None:
    """Add a data, or none."""
    one = parser.add_argument("data", nargs="?", metavar="SKILLSET.DATA", help="a data of a skillset (default: all)")
    completed_by(one, "data")


def events(parser: ArgumentParser) -> None:
    """Add which events are shown."""
    parser.add_argument("--follow", action="store_true", help="print events as they happen (default: those that the run has recorded)")
    completed_by(parser.add_argument("--skillset", metavar="NAME", help="only events of this skillset"), "skillsets")
