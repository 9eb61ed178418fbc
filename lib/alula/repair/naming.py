"""Names for the parts of a branch: the author's names from elsewhere, else words of the models, in the style of an author.

- A part with other skills has its author's names, with the words of one skill put in the place of another's.
- A skill, and a node that waits for something, is called what the author calls it elsewhere in the mission, or in the robot's others.
- A state is told as ``the link is up``, for ``link == UP``.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from alula.trees.attributes import node_name, type_name
from alula.trees.document import Element

_WORD = re.compile(r"[A-Za-z]+")
_TIMES = {1: "one chance", 2: "two chances", 3: "three chances"}
_WHERE = frozenset({"to", "into", "onto", "out", "around", "along", "through", "past", "behind", "up", "down", "back", "home", "there"})
MOST_NAMED = 3
"""How many results of a skill are named side by side."""
MOST_SHORT = 4
"""Letters of a word that ends with an s, and still names one thing."""
_OFTEN = {1: "once", 2: "twice", 3: "three times"}


class Renaming:
    """Replaces the words of one skill's name by those of another one, in the spelling of the file's author.

    ``zed_depthmap`` to ``lidar_depthmap`` makes *LiDAR sees* of *ZED sees*, and ``lidar_navigation`` of ``zed_navigation``. Where more than
    one word is another one, as in ``follow_corridor`` and ``drive_to``, nobody knows which stands for which: names stay as they are.
    """

    def __init__(self, old: str, new: str, texts: Iterable[str]) -> None:
        was, now = old.split("_"), new.split("_")
        gone = [one for one in was if one not in now]
        come = [one for one in now if one not in was]
        self._words: Mapping[str, str] = {gone[0]: come[0] if come else ""} if len(gone) == 1 and len(come) <= 1 else {}
        self._spelled = {word: spelled(word, texts) for word in come}

    def name(self, text: str) -> str:
        """Return a node's name with the words replaced."""
        for old, new in self._words.items():
            spelled = self._spelled.get(new, new)
            text = re.sub(rf"\b{old}\b", spelled, text, flags=re.IGNORECASE)
        return " ".join(text.split())

    def identifier(self, text: str) -> str:
        """Return the ID of a tree with the words replaced."""
        parts = text.split("_")
        return "_".join(word for word in (self._words.get(part, part) for part in parts) if word)


def spelled(word: str, texts: Iterable[str]) -> str:
    """Return the most frequent spelling of a word in texts, apart from names of code."""
    found = Counter(match[0] for text in texts for match in re.finditer(rf"(?<![\w.'{{]){word}(?![\w.}}])", text, re.IGNORECASE))
    return max(found, key=lambda one: (found[one], one)) if found else word


def plain(skill: str) -> str:
    """Return a skill's name as words."""
    return skill.rpartition(".")[2].replace("_", " ")


@dataclass(frozen=True)
class Vocabulary:
    """The author's names, by the nodes of the trees; of several names the first one counts.

    Attributes:
        nodes: those of the mission, then those of the robot's other missions.
    """

    nodes: Sequence[Element]

    def leaf(self, skill: str) -> str:
        """Return the author's name of a leaf with this skill, else the skill's name as words."""
        return next((node_name(one) for one in self.nodes if type_name(one) == skill and one.get("name")), plain(skill))

    def wait(self, condition: str, otherwise: str) -> str:
        """Return the author's name of a node that waits for a condition, or tests it, else another name."""
        asking = (one for one in self.nodes if condition in {one.get("if"), one.get("code")} and not one.children)
        return next((node_name(one) for one in asking if one.get("name")), otherwise)


def told_state(resource: str, *states: str, texts: Sequence[str] = ()) -> str:
    """Return a state in plain words: ``the pose is good`` for ``base.pose_status``, GOOD; of several, one of them.

    ``texts`` say how the author spells the resource's words.
    """
    words = [spelled(one, texts) for one in told_resource(resource).split()]
    either = listed((one if one == "OK" else one.lower().replace("_", " ") for one in states), "or")
    return f"the {' '.join(words)} {'are' if _several(words[-1]) else 'is'} {either}"


def _several(word: str) -> bool:
    """Return whether a word names several things: ``visitors``, but not ``chassis``, ``GPS`` or ``lens``."""
    return len(word) > MOST_SHORT and word.endswith("s") and not word.endswith(("ss", "us", "is"))


def told_resource(resource: str) -> str:
    """Return a resource's name as words: ``pose`` for ``base.pose_status``."""
    return resource.rpartition(".")[2].removesuffix("_status").removesuffix("_state").replace("_", " ")


def told_failure(name: str, results: Sequence[str]) -> str:
    """Return the failure of a node with one of these results: ``'drive' ends as BLOCKED``; with many results, only that it fails."""
    return f"'{name}' ends as {listed(results, 'or')}" if 0 < len(results) <= MOST_NAMED else f"'{name}' fails"


def told_states(several: Iterable[tuple[str, str]]) -> str:
    """Return several states in plain words, each a resource and its state, as a conjunction."""
    return " and ".join(told_state(resource, state) for resource, state in several)


def chances(attempts: int, skill: str = "") -> str:
    """Return the name of a node that retries another one; ``skill``: the name of that one, where it is a skill.

    One that is called by where it leads to, as ``to the valve``, gets there; ``go_to_dock`` is told in words.
    """
    times, skill = _TIMES.get(attempts, f"{attempts} chances"), skill.replace("_", " ")
    gets = "get " if skill.partition(" ")[0].lower() in _WHERE else ""
    return f"{times} to {gets}{skill}" if skill else times


def often_when(attempts: int, results: Iterable[str]) -> str:
    """Return the name of a node that repeats another one at most so often, as long as it ends with one of these results."""
    ends = " or ".join(one.lower().replace("_", " ") for one in results)
    return f"{_OFTEN.get(attempts, f'{attempts} times')} when {ends}"


def listed(several: Iterable[str], word: str = "and") -> str:
    """Return words as a list: ``a, b and c``."""
    *others, last = several
    return f"{', '.join(others)} {word} {last}" if others else last


def sentence(text: str) -> str:
    """Return a text with a capital first letter."""
    return text[:1].upper() + text[1:]


def in_short(steps: Sequence[str]) -> str:
    """Return one short name for several steps."""
    first, *others = dict.fromkeys(steps)
    return f"{first}, ..., {others[-1]}" if len(others) > 1 else " and ".join([first, *others])


def another(name: str, taken: Iterable[str]) -> str:
    """Return a name that is not taken."""
    used = set(taken)
    names = (name, *(f"{name}_{number}" for number in range(2, len(used) + 3)))
    return next(one for one in names if one not in used)


def assigned(leaves: Sequence[tuple[str, str]], wanted: Iterable[str]) -> dict[int, str]:
    """Return the requested names, by the leaves that they fit best: each leaf is its skill's name and its default name."""
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
