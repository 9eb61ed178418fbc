"""`python -m skill_language.check_cli FILE... [--json]`: read models and say what is wrong with them.

Ends with 0 when all is well (warnings do not count), 1 when a model has errors, 2 when a file can't be read: because it is not
there, is no text, or is not in the notation (ALU0.. and ALU1..).
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence

from skill_language.errors import Diagnostic, Severity, has_errors
from skill_language.load import check_file

UNREADABLE = ("ALU0", "ALU1")  # files, syntax


def main(arguments: Sequence[str] | None = None) -> int:
    """Check the files named on the command line; return the exit code."""
    parser = argparse.ArgumentParser(prog="alula check", description="Check skill models.")
    parser.add_argument("files", nargs="+", metavar="FILE", help="a skillset in the paper's notation (*.skill)")
    parser.add_argument("--json", action="store_true", help="print the findings as one JSON object instead of text")
    options = parser.parse_args(arguments)
    results = {file: check_file(file)[1] for file in options.files}
    findings = [finding for found in results.values() for finding in found]
    code = exit_code(findings)
    text = _as_json(results, code) if options.json else _as_text(results)
    sys.stdout.write(text + "\n")
    return code


def exit_code(findings: Sequence[Diagnostic]) -> int:
    """Return 0, 1 or 2 as in this module's docstring."""
    if any(finding.code.startswith(UNREADABLE) for finding in findings):
        return 2
    return 1 if has_errors(findings) else 0


def _as_json(results: dict[str, list[Diagnostic]], code: int) -> str:
    files = [{"file": file, "findings": [f.as_json() for f in found]} for file, found in results.items()]
    return json.dumps({"exit_code": code, "files": files}, indent=2)


def _as_text(results: dict[str, list[Diagnostic]]) -> str:
    parts: list[str] = []
    for file, found in results.items():
        errors = sum(finding.severity is Severity.ERROR for finding in found)
        warnings = len(found) - errors
        counts = [f"{n} {word}{'s' if n > 1 else ''}" for n, word in ((errors, "error"), (warnings, "warning")) if n]
        parts += [finding.render() + "\n" for finding in found]
        parts.append(f"{file}: {', '.join(counts) or 'ok'}")
    return "\n".join(parts)


if __name__ == "__main__":
    sys.exit(main())
