"""``alula editor``: serve an editor over the standard streams until it goes."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from alula.cli.table import parse
from alula.editor.server import serve


def main(words: Sequence[str] | None = None) -> int:
    """Serve on stdin and stdout until the editor closes them; return the exit code 0."""
    serve(trusted=parse("editor", words).trust)
    return 0


if __name__ == "__main__":
    sys.exit(main())
