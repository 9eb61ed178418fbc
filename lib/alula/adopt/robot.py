"""A robot's folder from trees of others: all that missions, mocks, proofs and reports need, as texts by their paths."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from alula.adopt.code import module_text
from alula.adopt.entries import GivenEntry
from alula.adopt.expected import expected_states
from alula.adopt.foreign import elements_of, foreign_types, known_registry, make_actions_of_missing_trees, needed
from alula.adopt.missions import MissionOf, Missions
from alula.adopt.rendering import decisions, names_of_nodes
from alula.adopt.skillset import faults_text, mocks_text, model_text, types_text
from alula.adopt.vocabulary import Vocabulary
from alula.check.checking import ENDLESS
from alula.generate.scaffold.skeleton import files_of
from alula.trees.errors import FileError, Problem, TreeError
from alula.trees.node_type import Category
from alula.trees.reading import TreeFiles
from alula.trees.structure import verify

TEMPLATES = Path(__file__).parent / "robot"


@dataclass(frozen=True)
class NewRobot:
    """A robot that is not written yet: ``files`` are texts by path, ``about`` counts, ``decisions`` say what a person has to see to."""

    files: dict[str, str]
    about: str
    scenarios: Sequence[str]
    decisions: Sequence[str]


def robot_from_trees(name: str, mains: Sequence[TreeFiles], folder: Path, wrong: Callable[[TreeError], object]) -> NewRobot:
    """Return the robot whose skills are the actions of main trees.

    Args:
        name: the robot's, which is its skillset's, too.
        mains: each main tree with all that it uses; a use of a tree that is in no file becomes an action in place.
        folder: what they were read from; their files are told from there on.
        wrong: takes what keeps a main tree from being put together: it is left out.

    Raises:
        TreeError: there is no main tree, or the trees have no action that needs a robot.
    """
    mains = [files for files in mains if _is_sound(files, wrong)]
    if not mains:
        raise TreeError(f"{folder}: there is no main tree that could be a mission")
    every = {tree for files in mains for tree in files.trees}
    mains = [needed(files) for files in mains]
    missing = {tree for files in mains for tree in make_actions_of_missing_trees(files)}
    trees = elements_of(mains)
    types = {one.name: replace(one, doc=one.doc.replace(f"{folder}/", "")) for one in foreign_types(mains).values()}
    subtrees = {one.name: one for files in mains for one in files.models.values() if one.category is Category.SUBTREE}
    vocabulary = Vocabulary.of(name, types, subtrees, trees)
    if not vocabulary.skills:
        raise TreeError(f"{folder}: its trees have no action of their own, so there is no skill to make; name a folder whose trees have")
    missions = Missions(mains, vocabulary, known_registry(mains), folder)
    unused = every - {tree for files in mains for tree in files.trees}
    to_decide = list(decisions(vocabulary, missions, missing=missing, unused=unused))
    states = expected_states(trees, vocabulary)
    files = {
        f"skillsets/{name}.skill": model_text(vocabulary, missions.entries),
        "skillsets/types.yaml": types_text(vocabulary, missions.entries),
        "skillsets/mock.yaml": mocks_text(vocabulary, states),
        "skillsets/faults.yaml": faults_text(vocabulary, states),
        f"python/{name}_trees.py": module_text(vocabulary),
        **{f"missions/{file}": text for file, text in missions.texts().items()},
        **{path: text for one in missions.all for path, text in _scenario(name, one)},
    }
    told = {
        "@first@": missions.all[0].name,
        "@skill@": next(iter(vocabulary.skills.values())).name,
        "@names_of_nodes@": "\n".join(names_of_nodes(vocabulary)),
        "@missions@": "\n".join(f"| `{one.name}` | `{one.main}` | `{one.source}` |" for one in missions.all),
        "@decisions@": "\n".join(f"- {one}." for one in to_decide) or "Nothing was found.",
    }
    for path, text in files_of(name, TEMPLATES).items():
        files[path] = _filled(text, told.items())
    counts = {"skill": len(vocabulary.skills), "resource": len(vocabulary.resources), "mission": len(missions.all)}
    about = ", ".join(f"{count} {what}{'' if count == 1 else 's'}" for what, count in counts.items())
    return NewRobot(dict(sorted(files.items())), about, [one.name for one in missions.all], to_decide)


def _is_sound(files: TreeFiles, wrong: Callable[[TreeError], object]) -> bool:
    """Return whether a main tree can be put together with its subtrees: none of them contains itself, and it is no giant."""
    found: list[Problem] = []
    verify(files, known_registry([files]), found.append, of_others=True)
    endless = [FileError(one) for one in found if one.code in ENDLESS]
    for error in endless[:1]:
        wrong(error)
    return not endless


def _filled(text: str, told: Iterable[tuple[str, str]]) -> str:
    for mark, words in told:
        text = text.replace(mark, words)
    return text


def _scenario(robot: str, mission: MissionOf) -> Iterator[tuple[str, str]]:
    """Yield the files of a scenario: it, and its world where the mission has one."""
    about = json.dumps(f"the tree {mission.main} of {mission.source}", ensure_ascii=False)
    lines = [f"about: {about}", f"mission: missions/{mission.name}.xml", f"skillsets: [{robot}]"]
    lines += [f"world: {mission.name}"] if mission.given else []
    yield f"scenarios/{mission.name}.yaml", "\n".join([*lines, ""])
    if mission.given:
        yield f"worlds/{mission.name}.yaml", _world(mission.given)


def _world(given: Iterable[GivenEntry]) -> str:
    lines = ["# What a program writes on the blackboard before the tree starts, which reads it: these values only stand for its own."]
    lines += [f"{json.dumps(one.name, ensure_ascii=False)}: {json.dumps(one.value, ensure_ascii=False)}" for one in given]
    return "\n".join([*lines, ""])
