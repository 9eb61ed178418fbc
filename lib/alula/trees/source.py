"""Where a tree is read from: its file, and what is needed besides to read it whole."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from alula.trees.errors import Report, refuse
from alula.trees.library import Library
from alula.trees.node_type import NodeType
from alula.trees.reading import TreeFiles, read_files, read_text


@dataclass(frozen=True)
class TreeSource:
    """The file of a tree and all that is needed to read it, the same for reading, checks, proofs and runs.

    Attributes:
        path: its file.
        library: the files whose trees it may use without including them, and the folders of ROS packages.
        main: the ID of its main tree, instead of what the file says itself.
        enums: numbers of names that its scripts use, which a program registers.
        types: types of node that are declared in other files (palettes).
    """

    path: Path
    library: Library = field(default_factory=Library)
    main: str = ""
    enums: Mapping[str, float] = field(default_factory=dict)
    types: Sequence[NodeType] = ()

    def read(self, report: Report = refuse, *, whole: bool = True, text: str | bytes | None = None) -> TreeFiles:
        """Read it, as `read_files` does; ``text`` is what its file will have."""
        if text is not None:
            return read_text(text, str(self.path), report, main=self.main, library=self.library, whole=whole)
        return read_files(self.path, report, main=self.main, library=self.library, whole=whole)


def source_of(mission: Path | TreeSource) -> TreeSource:
    """Return where a mission is read from; a path is that of a file that needs nothing else."""
    return mission if isinstance(mission, TreeSource) else TreeSource(mission)
