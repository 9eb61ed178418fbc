"""STATUSTEXT: long texts come in chunks."""

from __future__ import annotations

CHUNK = 50


class TextAssembler:
    """Put the chunks of a text together (fields ``id`` and ``chunk_seq``, MAVLink common)."""

    def __init__(self) -> None:
        self._id = 0
        self._parts: list[str] = []

    def take(self, text: str, text_id: int, chunk: int) -> str | None:
        """Return the whole text when its last chunk has come; one that lost a chunk is given up."""
        if text_id == 0:
            return text
        if chunk == 0 or text_id != self._id:
            self._id, self._parts = text_id, []
        if chunk != len(self._parts):
            self._id = 0
            return None
        self._parts.append(text)
        if len(text) == CHUNK:
            return None
        return "".join(self._parts)
