"""``alula editor``: serve an editor over the standard streams until it goes."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence


def main(words: Sequence[str] | None = None) -> int:
    """Serve on stdin and stdout until the editor closes them; return the exit code 0."""
    parser = argparse.ArgumentParser(prog="alula editor", description="A language server over the standard streams, for editors.")
    parser.parse_args(words)
    from alula.editor.server import serve  # late: --help does without pygls

    serve()
    return 0


if __name__ == "__main__":
    sys.exit(main())
