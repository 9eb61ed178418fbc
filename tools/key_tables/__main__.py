"""Writes the pages."""

from __future__ import annotations

from alula.common.files import write_text
from key_tables import pages

for path, text in pages():
    write_text(path, text)
