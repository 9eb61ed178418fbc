"""``alula generate ROBOT_FOLDER... --out DIR``: make ROS 2 packages and bridge configurations.

Ends with 0 when all was written, 2 when a model, a side file or the output folder is not as it should be; then nothing
was changed.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from alula.cli.table import parser_of
from alula.generate.interfaces import interface_package
from alula.generate.robot_files import robot_files
from alula.generate.writer import prune, write_files
from alula.language.errors import Diagnostic, LanguageError
from alula.language.load import load_robot
from alula.model.span import Span


def main(arguments: Sequence[str] | None = None) -> int:
    """Generate for the folders named on the command line; return the exit code."""
    parser = parser_of("generate")
    options = parser.parse_args(arguments)
    if options.name and len(options.robots) > 1:
        parser.error("--name: several robots can't have one name")
    try:
        files = _interfaces(options.robots) if options.interfaces else _all_files(options.robots, options.name)
        changed = write_files(files, options.out)
        if options.prune:
            prune(files, options.out)
    except LanguageError as error:
        sys.stderr.write(f"{error}\n")
        return 2
    except OSError as error:
        sys.stderr.write(f"{options.out}: can't be written: {error.strerror or error}\n")
        return 2
    for entry in sorted({path.split("/", 1)[0] for path in files}):
        sys.stdout.write(f"{options.out / entry}{'' if entry in changed else ' (as it was)'}\n")
    return 0


def _all_files(folders: Sequence[Path], name: str | None) -> dict[str, str]:
    """Return the files of all robots; raise LanguageError with the findings of all."""
    findings: list[Diagnostic] = []
    files: dict[str, str] = {}
    for folder in folders:
        try:
            robot = load_robot(folder)
            made = robot_files(replace(robot, name=name) if name else robot)
        except LanguageError as error:
            findings += error.diagnostics
            continue
        entries = {path.split("/", 1)[0] for path in made}
        for entry in sorted(entries & {path.split("/", 1)[0] for path in files}):
            message = f"`{entry}` would be generated for two robots; skillsets of all robots need different names"
            findings.append(Diagnostic("ALU404", message, Span(str(folder), 0, 0, 0)))
        files |= made
    if findings:
        raise LanguageError(findings)
    return files


def _told(action: str) -> list[str]:
    """Return what of an action goes over the wire: its fields, without the comments."""
    return [line for line in action.splitlines() if line and not line.startswith("#")]


def _interfaces(folders: Sequence[Path]) -> dict[str, str]:
    """Return the interface packages of all robots: one a name of a skillset, with the skills of all that are called so.

    Raises:
        LanguageError: of skillsets of one name, skills of one name are not the same in ROS.
    """
    robots = [load_robot(folder) for folder in folders]
    files: dict[str, str] = {}
    for name in dict.fromkeys(skillset.name for robot in robots for skillset in robot.skillsets):
        known = [(robot, one) for robot in robots for one in robot.skillsets if one.name == name]
        skills = {skill.name: skill for _, one in known for skill in one.skills}
        types = {kind: ros for robot, _ in known for kind, ros in robot.types.items()}
        merged = interface_package(replace(known[0][0], types=types), replace(known[0][1], skills=tuple(skills.values())))
        for folder, robot in zip(folders, robots, strict=True):
            own = {p: t for r, one in known if r is robot for p, t in interface_package(r, one).items() if p.endswith(".action")}
            for path in (path for path, text in own.items() if _told(merged[path]) != _told(text)):
                message = f"`{path}` is another action for another robot; a process that calls both needs one, so rename one of the skills"
                raise LanguageError([Diagnostic("ALU404", message, Span(str(folder), 0, 0, 0))])
        files |= merged
    return files


if __name__ == "__main__":
    sys.exit(main())
