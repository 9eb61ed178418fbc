"""Names of what a branch is made of: an author's own, with the words of one skill put in the place of another's."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence

_WORD = re.compile(r"[A-Za-z]+")


class Renaming:
    """Puts the words of a skill's name into the places of those of another one, spelled as the file's author spells them.

    ``zed_depthmap`` to ``lidar_depthmap`` makes *LiDAR sees* of *ZED sees*, and ``lidar_navigation`` of ``zed_navigation``.
    """

    def __init__(self, old: str, new: str, texts: Iterable[str]) -> None:
        was, now = old.split("_"), new.split("_")
        gone = [one for one in was if one not in now]
        come = [one for one in now if one not in was]
        self._words: Mapping[str, str] = dict(zip(gone, come, strict=False)) | dict.fromkeys(gone[len(come) :], "")
        self._spelled = {word: _spelled(word, texts) for word in come}

    def name(self, text: str) -> str:
        """Return a node's name with the other words."""
        for old, new in self._words.items():
            spelled = self._spelled.get(new, new)
            text = re.sub(rf"\b{old}\b", spelled, text, flags=re.IGNORECASE)
        return " ".join(text.split())

    def identifier(self, text: str) -> str:
        """Return the ID of a tree with the other words."""
        parts = text.split("_")
        return "_".join(word for word in (self._words.get(part, part) for part in parts) if word)


def _spelled(word: str, texts: Iterable[str]) -> str:
    """Return how a word is written most often, but in names of code."""
    found = Counter(match[0] for text in texts for match in re.finditer(rf"(?<![\w.'{{]){word}(?![\w.}}])", text, re.IGNORECASE))
    return max(found, key=lambda one: (found[one], one)) if found else word


def plain(skill: str) -> str:
    """Return a skill's name as words."""
    return skill.rpartition(".")[2].replace("_", " ")


def another(name: str, taken: Iterable[str]) -> str:
    """Return a name that nothing has yet."""
    used = set(taken)
    names = (name, *(f"{name}_{number}" for number in range(2, len(used) + 3)))
    return next(one for one in names if one not in used)


def assigned(leaves: Sequence[tuple[str, str]], wanted: Iterable[str]) -> dict[int, str]:
    """Return names that are asked for, by the leaves that they fit best: each leaf is its skill's name and what it would be called."""
    pairs = [(_alike(skill, name, one), number, one) for one in wanted for number, (skill, name) in enumerate(leaves)]
    found: dict[int, str] = {}
    for score, number, one in sorted(pairs, key=lambda pair: -pair[0]):
        if score and number not in found and one not in found.values():
            found[number] = one
    return found


def _alike(skill: str, name: str, wanted: str) -> int:
    asked = _words(wanted)
    mine, called = _words(skill.rpartition(".")[2].replace("_", " ")), _words(name)
    return 2 * sum(any(_same(one, other) for other in asked) for one in mine) + sum(one in asked for one in called - {"the"})


def _words(text: str) -> set[str]:
    return {one.lower() for one in _WORD.findall(text)}


def _same(one: str, other: str) -> bool:
    return one == other or (len(one) > 3 and other.startswith(one))
