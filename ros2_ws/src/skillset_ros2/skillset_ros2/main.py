"""The generated ``python -m <skillset>_managers``: serves a skillset with hooks that are named on the command line."""

from __future__ import annotations

import argparse
import sys
from types import ModuleType

from alula.model.model import Skillset
from alula.runtime.managers import DataBindings
from skillset_ros2.managers import find_factory
from skillset_ros2.spin import run_skillset


def main(skillset: Skillset, interfaces: ModuleType, data_bindings: DataBindings) -> None:
    """Serve with ``--hooks MODULE:FACTORY``; the other words are for ``run_skillset``. Exits with 2 when they are wrong."""
    parser = argparse.ArgumentParser(add_help=False, allow_abbrev=False)
    parser.add_argument("--hooks", required="-h" not in sys.argv and "--help" not in sys.argv, metavar="MODULE:FACTORY")
    options, words = parser.parse_known_args(sys.argv[1:])
    try:
        hooks_factory = find_factory(options.hooks) if options.hooks else dict
    except (ImportError, ValueError) as error:
        parser.error(f"--hooks {options.hooks}: {error}")
    again = ["--hooks", options.hooks] if options.hooks else []
    run_skillset(skillset, interfaces, hooks_factory, data_bindings=data_bindings, arguments=words, again=again)
