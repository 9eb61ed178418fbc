"""What the commands about models and missions take."""

from __future__ import annotations

from argparse import Action, ArgumentParser, Namespace
from pathlib import Path

from alula.cli.parser import completed_by, json_option, time_option

NOTATIONS = ("paper", "rl")
FORMAT = "4"
SHELLS = ("bash", "zsh", "fish")
PROOFS_S = 30.0
REPAIR_S = 60.0
NAV2_RELEASES = ("humble", "jazzy", "kilted", "lyrical")
TICKS = 10
MOST_SITUATIONS = 200_000
UNLIKELY = 1e-3
FILES_HELP = (
    "skillsets in the paper's notation (*.skill) or the Robot Language (*.rl), folders of them, or `-`: the standard input; "
    "missions (*.xml), projects of Groot2 (*.btproj), folders of them, whose trees may use one another"
)
MISSION_HELP = "a mission: BehaviorTree.CPP 4's XML"
PALETTE_HELP = "a TreeNodesModel with more types of node, as Groot2's"


def check(parser: ArgumentParser) -> None:
    """Add what ``alula check`` takes."""
    parser.add_argument("files", nargs="*", metavar="FILE", help=f"{FILES_HELP} (default: the robot's)")
    json_option(parser, "all findings, each with its place, code and counterexample,")
    parser.add_argument("--palette", action="append", default=[], metavar="FILE", help=f"with a mission: {PALETTE_HELP}")
    _trees(parser)
    parser.add_argument(
        "--closed-world", action="store_true", help="assume that transitions that are neither extern nor used by an effect are never taken"
    )
    parser.add_argument("--no-proofs", dest="proofs", action="store_false", help="skip the proofs")
    time_option(parser, PROOFS_S, " for the proofs of a file")
    parser.add_argument(
        "--play", type=int, metavar="N", help="play counterexample N of the output: in running managers, or as a run of the mission"
    )
    parser.add_argument(
        "--out", type=Path, metavar="DIR", help="with --play of a mission: folder for the run's files (default: runs/TIME-NAME)"
    )
    parser.add_argument("--strict", action="store_true", help="treat warnings as errors")
    parser.add_argument("--to", choices=NOTATIONS, help="print the models in this notation instead")


class _AddPackage(Action):
    """Takes ``NAME=DIR`` into a dictionary."""

    def __call__(self, parser: ArgumentParser, namespace: Namespace, values: object, option_string: str | None = None) -> None:
        """Add one; wrong ones end the process with exit code 2."""
        name, _, folder = str(values).partition("=")
        if not name or not folder or not Path(folder).is_dir():
            parser.error(f"argument {option_string}: {values} is no NAME=DIR with a folder that is there")
        setattr(namespace, self.dest, {**getattr(namespace, self.dest), name: Path(folder)})


def _trees(parser: ArgumentParser) -> None:
    """Add what commands about files of trees take in common."""
    enums = 'enumerators that scripts may use, as the program registers them: {"NAME": 1, ...}'
    parser.add_argument("--enums", type=Path, metavar="FILE", help=enums)
    _main_and_packages(parser)


def _main_and_packages(parser: ArgumentParser) -> None:
    """Add what says which trees are read."""
    parser.add_argument("--main", default="", metavar="ID", help="the main tree, where a file has several and does not say it")
    package = "the folder of a ROS package that an <include> names (default: those around, and those that are sourced)"
    parser.add_argument("--package", action=_AddPackage, default={}, metavar="NAME=DIR", help=package)


def odds(parser: ArgumentParser) -> None:
    """Add what ``alula odds`` takes."""
    parser.add_argument("file", type=Path, metavar="FILE", help=MISSION_HELP)
    changes = parser.add_argument(
        "--with",
        dest="changes",
        action="append",
        default=[],
        metavar="FAULT=UNITS",
        help="compute the odds as if a thing had so many units, or never failed: camera=2, camera=never",
    )
    completed_by(changes, "units")
    world = parser.add_argument("--world", default="", metavar="FILE|NAME", help="inputs of the mission (default: those of its scenario)")
    completed_by(world, "worlds")
    parser.add_argument(
        "--unlikely", type=float, default=UNLIKELY, metavar="P", help=f"leave out situations that are less likely ({UNLIKELY:g})"
    )
    parser.add_argument(
        "--most", type=int, default=MOST_SITUATIONS, metavar="N", help=f"bound on the situations that are searched ({MOST_SITUATIONS})"
    )
    parser.add_argument("--svg", type=Path, metavar="FILE", help="also draw the odds there")
    json_option(parser, "the odds")


def repair(parser: ArgumentParser) -> None:
    """Add what ``alula repair`` takes."""
    parser.add_argument("file", type=Path, metavar="FILE", help=MISSION_HELP)
    completed_by(parser.add_argument("--fault", default="", metavar="NAME", help="the fault to survive"), "faults")
    parser.add_argument("--finding", type=int, default=0, metavar="N", help="the number of the counterexample of `alula check` to answer")
    parser.add_argument("--goal", default="", metavar="CONDITION", help="a condition that counts as accomplished, as in properties")
    parser.add_argument("--within", default="", metavar="NODE", help="where the branch has to stand (default: anywhere)")
    _search(parser, "the mission with the branch")
    parser.add_argument("--svg", type=Path, metavar="FILE", help="draw the mission there, with the branch in a band")
    json_option(parser, "the branch")


def plan(parser: ArgumentParser) -> None:
    """Add what ``alula plan`` takes."""
    parser.add_argument(
        "skillsets",
        nargs="?",
        type=Path,
        metavar="SKILLSETS",
        help="a robot's folder, or its skillsets (default: the current folder's robot)",
    )
    goal = "the goal: skillset.resource == STATE, several with and, or, not; or a role that skills provide; `then` between"
    parser.add_argument("--goal", default="", metavar="CONDITION", help=goal)
    start = "the initial states: skillset.resource == STATE, several with and (default: as after power-up)"
    parser.add_argument("--from", dest="start", default="", metavar="CONDITION", help=start)
    _search(parser, "the mission")
    json_option(parser, "the mission")


def _search(parser: ArgumentParser, what: str) -> None:
    """Add what both searches for branches take."""
    parser.add_argument("--never", default="", metavar="CONDITION", help="a condition that no run of the mission may reach")
    parser.add_argument("--using", action="append", default=[], metavar="SKILLS", help="skills that may be added (default: all)")
    parser.add_argument(
        "--most-faults",
        type=int,
        default=2,
        choices=(1, 2),
        metavar="K",
        help="how many faults may come, one after another: 1 or 2 (default 2)",
    )
    time_option(parser, REPAIR_S, "")
    parser.add_argument("--out", type=Path, metavar="FILE", help=f"write {what} there (default: nothing is written)")


def tree(parser: ArgumentParser) -> None:
    """Add what ``alula tree`` takes."""
    parser.add_argument(
        "files",
        nargs="+",
        type=Path,
        metavar="FILE",
        help=f"{MISSION_HELP}; then files and folders whose trees it uses; a folder alone: each of its trees that is a part of no other",
    )
    parser.add_argument("--svg", type=Path, metavar="FILE", help="also write the drawing there")
    parser.add_argument("--palette", type=Path, action="append", default=[], metavar="FILE", help=PALETTE_HELP)
    _trees(parser)
    answers = 'what leaves answer: {"leaf name": ["RUNNING", "SUCCESS"], ...}, and entries, enums, stand-ins in sections'
    parser.add_argument("--answers", type=Path, metavar="FILE", help=answers)
    parser.add_argument("--seed", type=int, metavar="N", help="with --answers: seed of the answer ANY (default 0)")
    parser.add_argument("--to", choices=[FORMAT], help="convert a file of BehaviorTree.CPP 3 instead, and list what is left to decide")
    parser.add_argument("--out", type=Path, metavar="FILE", help="with --to: the file to write (default: the standard output)")
    parser.add_argument("--ticks", type=int, metavar="N", help=f"with --answers: number of ticks (default {TICKS})")
    parser.add_argument("--trace", action="store_true", help="with --answers: print what each tick changed: statuses, entries")
    parser.add_argument("--html", type=Path, metavar="FILE", help="with --answers: write a page that steps through the ticks")
    json_option(parser, "the tree, or each tick,")


def palette(parser: ArgumentParser) -> None:
    """Add what ``alula palette`` takes."""
    of_trees = "or other programs' trees: what they declare"
    parser.add_argument("places", nargs="*", metavar="FOLDER", help=f"the robot's models, as skillsets/uav; {of_trees}")
    parser.add_argument("--nav2", choices=NAV2_RELEASES, help="without a FOLDER: Nav2's nodes as this release declares them")
    parser.add_argument(
        "--guess",
        action="store_true",
        help="of other programs' trees: guess the declaration of each node that nobody declares from its uses",
    )


def generate(parser: ArgumentParser) -> None:
    """Add what ``alula generate`` takes."""
    parser.add_argument(
        "robots", nargs="+", metavar="FOLDER", type=Path, help="folder with the robot's models: *.skill, types.yaml, bindings.yaml"
    )
    parser.add_argument("--out", required=True, metavar="DIR", type=Path, help="folder for the generated packages and configurations")
    parser.add_argument(
        "--prune", action="store_true", help="remove everything else from DIR, such as packages of models that no longer exist"
    )
    parser.add_argument("--name", help="name of the robot (default: its folder's); only with one FOLDER")
    parser.add_argument("--interfaces", action="store_true", help="make interfaces only, one package for all skillsets of a name")


def editor(parser: ArgumentParser) -> None:
    """Add what ``alula editor`` takes."""
    parser.add_argument(
        "--trust", action="store_true", help="import the Python of the robots whose missions are opened, which knows their own nodes"
    )


def new(parser: ArgumentParser) -> None:
    """Add what ``alula new`` takes."""
    parser.add_argument("what", choices=["robot"], help="always robot")
    parser.add_argument("folder", metavar="DIR", type=Path, help="a new folder, whose name is the robot's: a-z, 0-9, _")
    parser.add_argument("--git", action="store_true", help="run git init in it")
    of_trees = "have its skills, mocks and missions made of a folder, or file, of Behaviour Trees"
    parser.add_argument("--from-trees", type=Path, metavar="FOLDER", help=of_trees)
    _main_and_packages(parser)


def completion(parser: ArgumentParser) -> None:
    """Add what ``alula completion`` takes."""
    parser.add_argument("shell", nargs="?", default=SHELLS[0], choices=SHELLS, help=f"the shell that evaluates it (default {SHELLS[0]})")


def command(parser: ArgumentParser) -> None:
    """Add what ``alula help`` takes."""
    completed_by(parser.add_argument("command", nargs="?", metavar="COMMAND", help="the command"), "commands")
