"""Hook of MkDocs: brings the pages that stand outside of docs/ into the site, and turns links between pages into the site's.

A page keeps the links that it has in the checkout, where forges and editors follow them. In the site, docs/ is the root, a page
from elsewhere has its path in the checkout, and a link to what is no page shows the path that it leads to.
"""

from __future__ import annotations

import os
import re
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ALULA_ROOT = Path(__file__).resolve().parents[2]
LINK = re.compile(r"^```.*?^```|(!?)\[([^\]]*)\]\(([^)\s]+)\)|`[^`]+`", re.MULTILINE | re.DOTALL)
"""A link, or code, in which nothing is a link."""


def pages_outside(nav: object, inside: Path) -> list[str]:
    """Return the paths in the checkout of all pages that the navigation names and that are not below docs/."""
    if isinstance(nav, str):
        return [] if (inside / nav).is_file() else [nav]
    children = nav.values() if isinstance(nav, dict) else nav if isinstance(nav, list) else ()
    return [path for child in children for path in pages_outside(child, inside)]


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages from outside of docs/, and the pictures that they show."""
    inside = Path(config.docs_dir)
    for path in pages_outside(config.nav, inside):
        files.append(File.generated(config, path, abs_src_path=str(ALULA_ROOT / path)))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Rewrite the links of a page, but for those in code."""
    source = Path(str(page.file.abs_src_path)).parent
    place = Path(page.file.src_uri).parent
    inside = Path(config.docs_dir)

    def moved(match: re.Match[str]) -> str:
        picture, words, target = match.groups()
        if target is None:
            return match[0]
        path, hash_, anchor = target.partition("#")
        if re.match(r"\w+:", target) or not path:
            return match[0]
        file = Path(os.path.normpath(source / path))
        uri = str(file.relative_to(inside) if file.is_relative_to(inside) else file.relative_to(ALULA_ROOT))
        if files.get_file_from_path(uri) is None:
            return f"{words} (`{uri}`)" if words.strip("`") != uri else f"`{uri}`"
        return f"{picture}[{words}]({os.path.relpath(uri, place)}{hash_}{anchor})"

    return LINK.sub(moved, markdown)
