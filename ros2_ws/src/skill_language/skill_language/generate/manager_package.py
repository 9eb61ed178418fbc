"""The package `<skillset>_managers`: the model, typed inputs, abstract hooks and a typed client, in Python."""

from __future__ import annotations

import json

from skill_language.generate.client_code import client_module
from skill_language.generate.manager_code import hooks_module, inputs_module
from skill_language.generate.mock_module import mock_module
from skill_language.generate.text import MAINTAINER, fill, header, lines, packages
from skill_language.json_form import to_json
from skill_language.model import Skillset
from skill_language.robot import Robot

PACKAGE_XML = """\
<?xml version="1.0"?>
<!-- $header. -->
<package format="3">
  <name>$package</name>
  <version>0.1.0</version>
  <description>The managers' side of the skillset $skillset: model, inputs, hooks to be written, client.</description>
  $maintainer
  <license>Apache-2.0</license>

  <depend>skill_language</depend>
  <depend>skill_runtime</depend>
$depends

  <export>
    <build_type>ament_python</build_type>
  </export>
</package>
"""

SETUP_PY = """\
# $header.
from setuptools import setup

setup(
    name="$package",
    version="0.1.0",
    packages=["$package"],
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/$package"]),
        ("share/$package", ["package.xml"]),
    ],
    install_requires=["setuptools"],
    zip_safe=True,
    maintainer="The Alula developers",
    maintainer_email="alula@alula-robotics.org",
    description="The managers' side of the skillset $skillset.",
    license="Apache-2.0",
    entry_points={"console_scripts": ["mock = $package.mock:main"]},
)
"""

SETUP_CFG = """\
# $header.
[develop]
script_dir=$$base/lib/$package
[install]
install_scripts=$$base/lib/$package
"""

INIT = '''\
"""The skillset ``$skillset``: model, inputs, hooks to be written, client.

$header.
"""
'''

MODEL = '''\
"""The model of the skillset ``$skillset``, and where its data come from.

$header.
"""

from skill_language.json_form import from_json

MODEL_JSON = r"""$model
"""

SKILLSET = from_json(MODEL_JSON)

DATA_TOPICS: dict[str, tuple[str, str]] = {
$data
}
"""Topic and ROS 2 type of each data, by the name of the data."""
'''


def manager_package(robot: Robot, skillset: Skillset) -> dict[str, str]:
    """Return the files of the managers' package."""
    package = f"{skillset.name}_managers"
    common = {"header": header(robot, skillset), "package": package, "skillset": skillset.name}
    parameters = [parameter for skill in skillset.skills for parameter in (*skill.inputs, *skill.outputs)]
    types = [robot.ros_type(p.type) for p in parameters] + [robot.message(data) for data in skillset.data]
    needed = [f"{skillset.name}_interfaces"] if skillset.skills else []
    depends = lines((f"<depend>{name}</depend>" for name in (*needed, *packages(types))), 2)
    return {
        f"{package}/package.xml": fill(PACKAGE_XML, **common, maintainer=MAINTAINER, depends=depends).replace("\n\n\n", "\n\n"),
        f"{package}/setup.py": fill(SETUP_PY, **common),
        f"{package}/setup.cfg": fill(SETUP_CFG, **common),
        f"{package}/resource/{package}": "",
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
