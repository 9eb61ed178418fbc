"""A key of a file that people write: what is said of it on the manual's pages, which `key_tables` writes from here."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Key:
    """What a key says, and what holds without it, both in Markdown; links are those of the page that lists it."""

    about: str
    without: str = ""
