"""Any name that the checker lets pass may stand in a model: the Python that is generated of it compiles and does what it should."""

from __future__ import annotations

import io
import keyword
import sys
import tokenize
import types

import pytest

from alula.generate import robot_files
from alula.generate.client_code import attribute_names
from alula.language import reserved_names
from alula.language.errors import LanguageError
from alula.language.load import load_robot
from alula.model.ros_types import camel
from alula.runtime import views
from alula.runtime.hooks import SkillHooks

SKILL = "skill go { input height: float64 output travelled: float64 success DONE }"
KINDS = {
    "skillset": SKILL,
    "skill": SKILL.replace("go", "NAME"),
    "input": SKILL.replace("height", "NAME"),
    "output": SKILL.replace("travelled", "NAME"),
    "result": SKILL.replace("DONE", "NAME"),
    "resource": f"resource NAME {{ state {{ A B }} initial A transition all }} {SKILL}",
    "data": f"data NAME: float64 {SKILL}",
}
FEWEST_ACCEPTED = 60


class Execution:
    """Returns what it is ended with."""

    def terminate(self, result, message="", outputs=None):
        return result, outputs


class Access:
    """Returns what it is asked to start."""

    def start(self, skill, **inputs):
        return skill, inputs


def load(folder, kind, name):
    """Return the robot of a model with this name in it; raise LanguageError where the model is refused."""
    skillset = name if kind == "skillset" else "odd"
    (folder / "odd.rl").write_text(f"skillset {skillset} {{ {KINDS[kind].replace('NAME', name)} }}")
    (folder / "bindings.yaml").write_text(f"data: {{{skillset}.{name}: {{topic: /topic}}}}\n" if kind == "data" else "{}\n")
    return load_robot(folder)


@pytest.fixture(scope="module")
def words(tmp_path_factory):
    """All names in generated code and in the classes that it derives from, and the words of Python."""
    files = robot_files(load(tmp_path_factory.mktemp("robot"), "data", "level"))
    texts = (text for path, text in files.items() if path.rsplit("/", 1)[-1] in {"inputs.py", "hooks.py", "client.py"})
    tokens = (token for text in texts for token in tokenize.generate_tokens(io.StringIO(text).readline))
    found = {token.string for token in tokens if token.type == tokenize.NAME} | {*keyword.kwlist, "none", "true", "false"}
    for base in (SkillHooks, views.TypedSkillset, views.Skill):
        found |= set(dir(base))
    return sorted({name.lower() for name in found | reserved_names.ROBOT if not name.startswith("_")})


def load_if_accepted(folder, kind, name):
    """Return the robot; None where the name is refused, for that reason alone."""
    try:
        return load(folder, kind, name)
    except LanguageError as refused:
        other = {finding.code for finding in refused.diagnostics} - {"ALU103", "ALU215", "ALU216"}
    assert not other, (kind, name)
    return None


def modules_of(files, skillset, monkeypatch):
    """Run the generated modules of inputs, hooks and client."""
    made = {}
    for part in ("inputs", "hooks", "client"):
        path = f"{skillset}_managers/{skillset}_managers/{part}.py"
        made[part] = module = types.ModuleType(f"{skillset}_managers.{part}")
        monkeypatch.setitem(sys.modules, module.__name__, module)
        exec(compile(files[path], path, "exec"), module.__dict__)  # noqa: S102 - what was generated just now
    return made


@pytest.mark.parametrize("kind", KINDS)
def test_generated_code_works_with_every_name_that_is_accepted(kind, words, tmp_path, monkeypatch):
    accepted = 0
    for word in words:
        robot = load_if_accepted(tmp_path, kind, word)
        if robot is None:
            continue
        accepted += 1
        files, (skillset,) = robot_files(robot), robot.skillsets
        try_out(modules_of(files, skillset.name, monkeypatch), skillset)
        (module,) = (text for path, text in files.items() if path.endswith("robot.py"))
        assert not [line for line in module.splitlines() for name in reserved_names.ROBOT if line.strip().startswith(f"self.{name} =")]
    assert accepted >= FEWEST_ACCEPTED


def try_out(modules, skillset):
    (skill,) = skillset.skills
    client = getattr(modules["client"], f"{camel(skillset.name)}Client")(Access())
    attributes = attribute_names(skillset)[0]
    inputs, outputs = ({parameter.name: 1.0 for parameter in parameters} for parameters in (skill.inputs, skill.outputs))
    assert getattr(client, attributes[skill.name])(**inputs) == (skill.name, inputs)
    assert isinstance(client.client, Access)
    for data in skillset.data:
        assert isinstance(getattr(client.data, data.name), views.DataView)
    abstract = getattr(modules["hooks"], f"Abstract{camel(skill.name)}Skill")
    hooks = type("Hooks", (abstract,), {"on_dispatch": lambda *_: None, "on_interrupt": lambda *_: None})()
    given = hooks.make_inputs(inputs)
    assert {name: getattr(given, name) for name in inputs} == inputs
    result = skill.results[0].name
    assert getattr(hooks, f"terminated_{result}")(Execution(), **outputs) == (result, outputs)
