"""What the commands that run missions take, and those about what runs have left."""

from __future__ import annotations

from argparse import ArgumentParser
from pathlib import Path

from alula.cli.parser import completed_by, json_option, time_option, within_option

FAULT = "WHAT[:HOW][@SECONDS[-SECONDS]]"
ANSWERS_S = 120.0
SKILLS, FUNCTIONAL, SENSORS = "skills", "functional", "sensors"
DEPTHS = (SKILLS, FUNCTIONAL, SENSORS)
"""Layers whose record can be replayed, from the mission downwards; the lower two need an installation, and the last one a robot's part."""
MEMBERS = "--with"
"""Of a fleet: options of its robots' own runs."""


def every_run(parser: ArgumentParser) -> None:
    """Add what a run over mocks takes, and a live one, too."""
    completed_by(parser.add_argument("scenario", metavar="SCENARIO", help="name of the scenario"), "scenarios")
    fail = parser.add_argument(
        "--fail", action="append", default=[], metavar=FAULT, help="a fault, seconds after the departure; repeatable"
    )
    completed_by(fail, "faults")
    world = parser.add_argument(
        "--world", default="", metavar="FILE|NAME", help="surroundings and inputs of the mission (default: the scenario's)"
    )
    completed_by(world, "worlds")
    parser.add_argument("--seed", type=int, default=0, help="seed of all random choices (default 0)")
    parser.add_argument("--out", type=Path, metavar="DIR", help="folder for the results (default: runs/TIME-SCENARIO of the robot)")
    parser.add_argument("--monitor", action="store_true", help="check every event against the models")
    parser.add_argument(
        "--groot", nargs="?", const="", metavar="[HOST:]PORT", help="serve the tree to Groot2 and other viewers (127.0.0.1:1667)"
    )
    parser.add_argument("--limit", type=float, default=0.0, metavar="SECONDS", help="end the run after this time of mission clock")
    parser.add_argument("--mock", action="store_true", help="run over mocks in virtual time: without simulator and ROS, in about a second")
    parser.add_argument(
        "--behaviour", type=Path, action="append", default=[], metavar="FILE", help="with --mock: behaviour file, on top of the robot's"
    )


def run(parser: ArgumentParser) -> None:
    """Add what a live ``alula run`` takes of every robot; a robot's part adds its own."""
    every_run(parser)
    on = parser.add_argument(
        "--on",
        default="",
        metavar="DEPLOYMENT",
        help="run on what runs already, as deployments/DEPLOYMENT.yaml says",
    )
    completed_by(on, "deployments")
    parser.add_argument("--console", action="store_true", help="serve the operator's page beside the run")
    parser.add_argument("--domain", type=int, metavar="N", help="run in this DDS domain (default: a free one)")
    parser.add_argument(
        "--namespace", default="", metavar="NAME", help="put its ROS 2 names below this one: runs with one may share a domain"
    )
    parser.add_argument(
        "--commanded",
        action="store_true",
        help="with a scenario without a mission: have simulated time wait for the program that calls the skills",
    )
    parser.add_argument("--options", dest="tell_options", action="store_true", help="print the robot's own options as JSON, and exit")


def fleet_run(parser: ArgumentParser) -> None:
    """Add what the live run of a fleet takes besides."""
    parser.add_argument("--served", action="store_true", help="the robots run already, in the DDS domain of --domain: start none")
    parser.add_argument(MEMBERS, dest="options", action="append", default=[], metavar="ROBOT:OPTION", help="an option of a robot's own run")


def replay(parser: ArgumentParser, depths: tuple[str, ...] = DEPTHS) -> None:
    """Add what ``alula replay`` takes; ``depths``: the layers whose record can be replayed here."""
    parser.add_argument("run", type=Path, metavar="RUN", help="a run's folder, its skills.mcap or its functional.bag")
    parser.add_argument(
        "--from", dest="depth", choices=depths, default=SKILLS, help=f"the layer whose record is replayed (default {SKILLS})"
    )
    parser.add_argument("--tree", default="", metavar="FILE.xml", help="use the tree of another mission's file")
    parser.add_argument(
        "--model", type=Path, action="append", default=[], metavar="FILE", help="use another model of a skillset; repeatable"
    )
    parser.add_argument(
        "--set", action="append", default=[], dest="settings", metavar="NAME=VALUE", help="change a parameter of the mission; repeatable"
    )
    fail = parser.add_argument(
        "--fail",
        action="append",
        default=[],
        metavar="WHAT[@SECONDS[-SECONDS]]",
        help="inject a fault that the recorded run did not have; repeatable",
    )
    completed_by(fail, "faults")
    parser.add_argument(
        "--behaviour",
        type=Path,
        action="append",
        default=[],
        metavar="FILE",
        help="behaviour file of the mocks that stand in where nothing was recorded",
    )
    parser.add_argument(
        "--map",
        action="append",
        default=[],
        dest="names",
        metavar="/THEIRS:=/OURS",
        help=f"with --from {SENSORS}: read a topic of the bag under another name",
    )
    parser.add_argument("--on", action="store_true", help="continue over mocks after the first difference")
    parser.add_argument("--rate", type=float, default=0.0, help="mission seconds per second at most (default 0: no limit)")
    parser.add_argument("--out", type=Path, metavar="DIR", help="folder for the replay's own record, summary, pictures and report")
    parser.add_argument("--expect", type=Path, metavar="FILE", help="check the replay against expectations; they decide the exit code")
    parser.add_argument("--junit", type=Path, metavar="FILE", help="with --expect: also write the results as JUnit XML")
    json_option(parser, "each decision")


def expect(parser: ArgumentParser) -> None:
    """Add what ``alula expect`` takes."""
    parser.add_argument("run", type=Path, metavar="RUN", help="a run's folder, or its log")
    parser.add_argument("--check", type=Path, metavar="FILE", help="check the run against this file instead of writing one")
    parser.add_argument("--junit", type=Path, metavar="FILE", help="with --check: also write the results as JUnit XML")


def conform(parser: ArgumentParser) -> None:
    """Add what ``alula conform`` takes."""
    parser.add_argument("log", type=Path, metavar="LOG", help="a run's folder, skills.mcap, a bag with Event messages, or events.jsonl")
    parser.add_argument(
        "--model",
        type=Path,
        action="append",
        default=[],
        metavar="FILE",
        help="check it against this model (default: the models of the managers that wrote it)",
    )
    parser.add_argument("--complete", action="store_true", help="exit with 1 if the log has a gap, breaks off, or ends within a step")
    json_option(parser, "the verdict")


def compare(parser: ArgumentParser) -> None:
    """Add what ``alula compare`` takes."""
    parser.add_argument("runs", type=Path, nargs="+", metavar="RUN", help="two or more folders of runs, or logs")
    json_option(parser, "the comparison")
    parser.add_argument("--svg", type=Path, metavar="FILE", help="also draw the skills of all runs over time")
    within_option(parser, "each decision may come sooner or later than in the first run by so much, and change places (default: in order)")


def campaign(parser: ArgumentParser) -> None:
    """Add what ``alula campaign`` takes."""
    parser.add_argument("file", type=Path, metavar="FILE", help="campaign file (docs/how-to/campaigns.md)")
    parser.add_argument(
        "--out", type=Path, metavar="DIR", help="folder for the results (default: runs/campaign-NAME); an interrupted one continues there"
    )
    parser.add_argument(
        "--dask", metavar="URL", help="use the workers of this Dask scheduler, such as tcp://host:8786 (default: this machine)"
    )
    time_option(parser, ANSWERS_S, " for the proof of a mission's answers")
