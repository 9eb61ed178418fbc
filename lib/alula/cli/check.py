"""`alula check [FILE...]`: read models and missions, say what is wrong with them, and prove the rest.

A model without errors is handed to the prover; what that finds is told with the rest, on standard output. With ``--to`` the models
are printed there instead, and findings go to standard error.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

from alula.api.checking import checked_files, prove_files, robot_models
from alula.cli.saying import warner
from alula.cli.table import parse
from alula.common.files import json_line
from alula.common.garbage import collect_seldom
from alula.common.robots import RobotError, find_robot
from alula.language.errors import Diagnostic, Severity, has_errors, render
from alula.language.models import ModelFile
from alula.language.notation import Notation
from alula.language.printer import print_file
from alula.trees.enums import read_enums
from alula.trees.errors import TreeError

COMMAND = "alula check"
UNREADABLE = "ALU0"


def main(arguments: Sequence[str] | None = None) -> int:
    """Check the files named on the command line; return the exit code."""
    options = parse("check", arguments)
    collect_seldom()
    warn = warner(COMMAND)
    try:
        enums = {} if options.enums is None else read_enums(options.enums)
    except TreeError as error:
        warn(str(error))
        return 2
    if options.play is not None:
        from alula.cli import play  # it takes the counterexamples from here

        return play.run(options, enums)
    try:
        given = options.files or robot_models(find_robot())
    except RobotError as error:
        sys.stderr.write(f"{COMMAND}: no files are named, and {error}\n")
        return 2
    files = checked_files(
        given, sys.stdin.buffer, palettes=options.palette, main=options.main, packages=options.package, enums=enums, on_progress=warn
    )
    if options.proofs and options.to is None:
        prove_files(files, options.time, closed_world=options.closed_world, on_progress=warn)
    for file in files:
        file.findings = [_strict(finding) for finding in file.findings] if options.strict else file.findings
    findings = [finding for file in files for finding in file.findings]
    code = exit_code(findings)
    if options.to is not None:
        return _convert(files, Notation(options.to), code)
    if options.json:
        found = [{"file": file.path, "findings": [one.as_json() for one in file.findings]} for file in files]
        sys.stdout.write(json_line({"exit_code": code, "files": found}))
    else:
        _write(_as_text(files))
    return code


def exit_code(findings: Sequence[Diagnostic]) -> int:
    """Return 0, proved, or nothing but warnings; 1, a model has errors or a property fails; 2, a file can't be read."""
    if any(finding.severity is Severity.ERROR and finding.code.startswith(UNREADABLE) for finding in findings):
        return 2
    return 1 if has_errors(findings) else 0


def _convert(files: Sequence[ModelFile], notation: Notation, code: int) -> int:
    """Print what could be read whole in a notation, findings beside it; one of several files begins with its name."""
    for file in files:
        if file.findings:
            sys.stderr.write(render(file.findings) + "\n")
    whole = [file for file in files if not file.damaged]
    for file in whole:
        title = f"// {file.path}\n" if len(files) > 1 else ""
        types = [kind.name for kind in file.document.types] if file.document else []
        _write(title + print_file(file.declared, notation, types).rstrip("\n"))
    # A model with errors of meaning is converted, too, but not silently.
    return code


def _strict(finding: Diagnostic) -> Diagnostic:
    return finding if finding.severity is Severity.NOTE else replace(finding, severity=Severity.ERROR)


def _write(text: str) -> None:
    """Write to the standard output whatever its encoding; names and paths may hold anything."""
    encoding = sys.stdout.encoding or "utf-8"
    sys.stdout.write(text.encode(encoding, "backslashreplace").decode(encoding) + "\n")


def _as_text(files: Sequence[ModelFile]) -> str:
    parts: list[str] = []
    number = 0
    for file in files:
        numbers = Counter(finding.severity for finding in file.findings)
        counts = [f"{n} {severity.value}{'s' if n > 1 else ''}" for severity in Severity if (n := numbers[severity])]
        if not numbers[Severity.ERROR] + numbers[Severity.WARNING]:
            counts.insert(0, "ok")
        for finding in file.findings:
            number += finding.playable
            playable = f"      = counterexample {number}: `--play {number}` plays it\n"
            parts.append(f"{finding.render()}\n{playable if finding.playable else ''}")
        parts.append(f"{file.path}: {', '.join(counts)}")
    return "\n".join(parts)


if __name__ == "__main__":
    sys.exit(main())
