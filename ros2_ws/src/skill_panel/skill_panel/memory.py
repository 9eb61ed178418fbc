"""The inputs that were last used, kept from one panel to the next."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Mapping
from pathlib import Path


class Memory:
    """The texts of each skill's inputs, in a JSON file that may be absent or unreadable; ``path`` None keeps them for now only."""

    def __init__(self, path: Path | None) -> None:
        self._path = path
        self._texts: dict[str, dict[str, str]] = {}
        if path is not None:
            with contextlib.suppress(OSError, ValueError):
                self._texts = _checked(json.loads(path.read_text(encoding="utf-8")))

    def texts(self, skillset: str, skill: str) -> dict[str, str]:
        """Return the last texts by input; empty when there are none."""
        return dict(self._texts.get(f"{skillset}.{skill}", {}))

    def keep(self, skillset: str, skill: str, texts: Mapping[str, str]) -> None:
        """Remember the texts of a start."""
        self._texts[f"{skillset}.{skill}"] = dict(texts)
        if self._path is None:
            return
        with contextlib.suppress(OSError):  # a panel that can't write goes on
            self._path.parent.mkdir(parents=True, exist_ok=True)
            aside = self._path.with_suffix(".new")
            aside.write_text(json.dumps(self._texts, indent=1), encoding="utf-8")
            aside.replace(self._path)


def _checked(read: object) -> dict[str, dict[str, str]]:
    """Return what was read if it is what `keep` writes; raise ValueError."""
    if not isinstance(read, dict):
        raise ValueError("no object")  # noqa: TRY004 - the caller takes ValueError for unreadable
    return {str(skill): {str(k): str(v) for k, v in texts.items()} for skill, texts in read.items() if isinstance(texts, dict)}
