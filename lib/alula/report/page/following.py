"""Follows what a run leaves in its folder, while it goes on or afterwards: the record, and the files beside it."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from alula.common import run_log
from alula.common.files import strict
from alula.common.record import FILE, OPERATOR, Entry, RecordError, RecordFollower
from alula.common.robots import page_words
from alula.report.page.areas import areas_of
from alula.report.page.causes import Causes, Explanation
from alula.report.page.clouds import CloudError, packed, read_points
from alula.report.page.embedded import REPORT, read_report
from alula.report.page.entries import AREAS, CAUSES, MAP, OF_RECORDINGS, PARTS, PICTURE, RUN, SUMMARY, Converter, Wire
from alula.report.page.lines import LinesFollower

OF_A_PART = ("state", "deaths", "why")
OF_THE_MACHINE = ("out_dir", "run_id")
"""Of ``run.json``, what a reader of the page can't use."""


class RunFollower:
    """Follows one run. ``problems`` names what could not be read.

    ``recordings``: what the run's other recordings tell; without it, this is taken from the run's report once there is one.
    ``summary``: the run's, without its causes; without it, this is taken from its file.
    """

    def __init__(self, folder: Path, recordings: Iterable[Wire] | None = None, summary: Mapping[str, object] | None = None) -> None:
        self.folder = folder
        self._of_recordings = recordings
        self._summary = summary
        self.problems: list[str] = []
        self.behind = False
        self._converter = Converter()
        self._causes = Causes()
        self._record = RecordFollower(folder / FILE)
        self._lines = [
            LinesFollower(folder / run_log.FILE, OPERATOR, kind=run_log.ACT),
            LinesFollower(folder / run_log.PICTURES_FILE, PICTURE),
        ]
        self._files: list[tuple[Path, str, Callable[[Path], Any]]] = [
            (folder / "run.json", RUN, self._run),
            (folder / "run.json", AREAS, lambda path: areas_of(str(_json(path).get("world") or ""))),
            (folder / "map.ply", MAP, lambda path: packed(read_points(path))),
            (folder / "state.json", PARTS, _parts),
        ]
        if summary is None:
            self._files.append((folder / "summary.json", SUMMARY, self._read_summary))
        self._seen: dict[str, tuple[int, int]] = {}
        self._told = False

    @property
    def explanation(self) -> Explanation:
        """Failures and their causes, as by the last call of ``poll``."""
        return self._causes.explanation

    def poll(self, limit: int | None = None) -> list[Wire]:
        """Return what came since the last call, what belongs to the whole run first.

        ``limit``: read so many entries of the record at most; ``behind`` says then that there may be more.
        """
        entries = [*self._changed_files(), *self._given_summary(), *self._recordings(), *self._new_entries(limit)]
        for entry in entries:
            self._causes.take(entry)
        told = None if self.behind else self._causes.told()
        return entries if told is None else [*entries, (CAUSES, None, told)]

    def _changed_files(self) -> Iterator[Wire]:
        for path, topic, read in self._files:
            try:
                stat = path.stat()
                version = (stat.st_mtime_ns, stat.st_size)
                if self._seen.get(topic) == version:
                    continue
                self._seen[topic] = version
                yield topic, None, read(path)
            except FileNotFoundError:
                continue
            except (OSError, ValueError, TypeError, CloudError) as error:
                self._note(f"{path.name}: {error}")

    def _given_summary(self) -> Iterator[Wire]:
        """Yield, once, the summary that was given."""
        given, self._summary = self._summary, None
        if given is not None:
            yield SUMMARY, None, strict(dict(given))

    def _recordings(self) -> list[Wire]:
        """Return, once, what the run's other recordings tell."""
        if self._told:
            return []
        if self._of_recordings is not None:
            self._told = True
            return list(self._of_recordings)
        path = self.folder / REPORT
        if not path.is_file():
            return []
        self._told = True
        try:
            return [entry for entry in read_report(path) if entry[0] in OF_RECORDINGS]
        except (OSError, ValueError) as error:
            self._note(f"{path.name}: {error}")
            return []

    def _new_entries(self, limit: int | None) -> list[Wire]:
        entries: list[Entry] = []
        try:
            entries += self._record.poll(limit)
            self.behind = limit is not None and len(entries) >= limit
            entries += [entry for lines in self._lines for entry in lines.poll()]
        except (RecordError, OSError) as error:
            self._note(str(error))
        if self._record.broken:
            self._note(f"{FILE}: {self._record.broken}")
        return [wire for entry in entries for wire in self._converter.convert(entry)]

    def _note(self, sentence: str) -> None:
        if sentence not in self.problems:
            self.problems.append(sentence)

    def _run(self, path: Path) -> dict[str, Any]:
        values = _json(path)
        world = Path(str(values.get("world") or "")).stem
        return {
            **{key: value for key, value in values.items() if key not in OF_THE_MACHINE},
            "world": world,
            "name": self.folder.name,
            "words": page_words(),
        }

    def _read_summary(self, path: Path) -> dict[str, Any]:
        """Return the summary without the causes, which are an entry of their own."""
        values: dict[str, Any] = _json(path)
        self._causes.settle(values.pop("causes", None))
        return values


def _parts(path: Path) -> Any:
    """Return what runs of a deployment, as its keeper has written it."""
    state = _json(path)
    parts = [{"name": name, **{key: part.get(key) for key in OF_A_PART}} for name, part in state["parts"].items()]
    return {"parts": parts, "master": state.get("master", {}), "disk": state.get("disk", "")}


def _json(path: Path) -> Any:
    value = json.loads(path.read_text(encoding="utf-8"))
    if not isinstance(value, dict):
        raise TypeError("is no JSON object")
    return value
