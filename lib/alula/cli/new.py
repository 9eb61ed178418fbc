"""``alula new robot DIR``: make a robot, a working repository in a folder of its own.

Ends with 0 when it was written, 2 when the folder's name can't be used or something is in it already; then nothing was written.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Sequence

from alula.cli.table import parse
from alula.generate.scaffold.skeleton import ScaffoldError, check, files_of, write


def main(arguments: Sequence[str] | None = None) -> int:
    """Make what the command line asks for; return the exit code."""
    options = parse("new", arguments)
    folder = options.folder.expanduser().absolute()
    files = files_of(folder.name)
    try:
        check(folder)
        write(folder, files)
    except ScaffoldError as error:
        sys.stderr.write(f"alula new: {error}\n")
        return 2
    except OSError as error:
        sys.stderr.write(f"alula new: {error.filename}: can't be written: {error.strerror}\n")
        return 2
    if options.git and subprocess.run(["git", "init", "--quiet", str(folder)], check=False).returncode:
        return 2
    sys.stdout.write("".join(f"{path}\n" for path in files))
    sys.stdout.write(f"\nNext: cd {options.folder} && alula test, and read README.md there\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
