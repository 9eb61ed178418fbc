"""``alula editor``: serve an editor over the standard streams until it goes."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence


def main(words: Sequence[str] | None = None) -> int:
    """Serve on stdin and stdout until the editor closes them; return the exit code 0."""
    parser = argparse.ArgumentParser(prog="alula editor", description="A language server over the standard streams, for editors.")
    parser.add_argument(
        "--trust", action="store_true", help="import the Python of the robots whose missions are opened, which knows their own nodes"
    )
    given = parser.parse_args(words)
    from alula.editor.server import serve  # late: --help does without pygls

    serve(trusted=given.trust)
    return 0


if __name__ == "__main__":
    sys.exit(main())
