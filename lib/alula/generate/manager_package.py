"""The package `<skillset>_managers`: the model, typed inputs, abstract hooks and a typed client, in Python."""

from __future__ import annotations

import json

from alula.generate.client_code import client_module
from alula.generate.manager_code import hooks_module, inputs_module
from alula.generate.mock_module import mock_module
from alula.generate.python_package import package_files
from alula.generate.text import fill, header, lines, packages
from alula.language.robot import Robot
from alula.model.json_form import to_json
from alula.model.model import Skillset

INIT = '''\
"""The skillset ``$skillset``: model, inputs, hooks to be written, client.

$header.
"""
'''

MODEL = '''\
"""The model of the skillset ``$skillset``, and where its data come from.

$header.
"""

from alula.model.json_form import from_json

MODEL_JSON = r"""$model
"""

SKILLSET = from_json(MODEL_JSON)

DATA_TOPICS: dict[str, tuple[str, str]] = {
$data
}
"""Topic and ROS 2 type of each data, by the name of the data."""
'''

MAIN = '''\
"""Serves the skillset ``$skillset``: ``python -m $package --hooks MODULE:FACTORY [--processes separate] [--ros-args ...]``.

$header.
"""

import $actions

from skillset_ros2.main import main
from $package.model import DATA_TOPICS, SKILLSET

main(SKILLSET, $actions, DATA_TOPICS)
'''


def manager_package(robot: Robot, skillset: Skillset) -> dict[str, str]:
    """Return the files of the managers' package."""
    package = f"{skillset.name}_managers"
    common = {"header": header(robot, skillset), "package": package, "skillset": skillset.name}
    parameters = [parameter for skill in skillset.skills for parameter in (*skill.inputs, *skill.outputs)]
    types = [robot.ros_type(p.type) for p in parameters] + [robot.message(data) for data in skillset.data]
    needed = [f"{skillset.name}_interfaces"] if skillset.skills else []
    around = package_files(
        package,
        common["header"],
        f"The managers' side of the skillset {skillset.name}",
        "model, inputs, hooks to be written, client",
        ("alula", "skillset_ros2", *needed, *packages(types)),
        script=f"mock = {package}.mock:main",
    )
    main = {f"{package}/{package}/__main__.py": fill(MAIN, **common, actions=f"{skillset.name}_interfaces.action")}
    return (main if skillset.skills else {}) | {
        **around,
        f"{package}/{package}/__init__.py": fill(INIT, **common),
        f"{package}/{package}/model.py": _model_module(robot, skillset),
        f"{package}/{package}/inputs.py": inputs_module(robot, skillset),
        f"{package}/{package}/hooks.py": hooks_module(robot, skillset),
        f"{package}/{package}/client.py": client_module(robot, skillset),
        f"{package}/{package}/mock.py": mock_module(robot, skillset),
    }


def _model_module(robot: Robot, skillset: Skillset) -> str:
    sources = [
        f"{json.dumps(data.name)}: ({json.dumps(robot.source(skillset, data).topic)}, {json.dumps(robot.message(data).ros2)}),"
        for data in skillset.data
    ]
    # JSON escapes every quote inside a string, so that three in a row never end the literal.
    text = fill(MODEL, skillset=skillset.name, header=header(robot, skillset), model="$model", data=lines(sources, 4))
    return text.replace("{\n\n}", "{}").replace("$model", to_json(skillset, indent=1))
