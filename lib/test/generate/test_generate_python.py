"""The Python that is generated runs, and is formatted."""

from __future__ import annotations

import ast
import importlib
import json
import shutil
import subprocess
import sys
import types

import pytest

from alula.generate import robot_files
from alula.generate.writer import write_files
from alula.language.load import load_robot


class Execution:
    """Records what it is ended with."""

    def __init__(self):
        self.ended = None

    def terminate(self, result, message="", outputs=None):
        self.ended = (result, message, outputs)
        return True


class Stub:
    """Stands for a class of the runtime that is made with a client and a name."""

    def __class_getitem__(cls, _):
        return cls

    def __init__(self, client, name):
        self.made = (client, name)

    def start(self, inputs):
        return (self.made[1], inputs)


@pytest.fixture
def generated(files, tmp_path, monkeypatch):
    """Import the generated package with a stand-in for the runtime, and without any ROS."""
    runtime, hooks, handle, views = (types.ModuleType(f"alula.runtime{name}") for name in ("", ".hooks", ".handle", ".views"))
    runtime.__path__ = []
    hooks.SkillHooks = type("SkillHooks", (), {"progress": lambda self, execution: 0.125})
    hooks.unwritten = lambda hook: hook
    handle.Handle = Stub
    views.Access, views.DataView, views.ResourceView, views.Skill = Stub, Stub, Stub, Stub
    views.TypedSkillset = type("TypedSkillset", (), {"__init__": lambda self, client: setattr(self, "client", client)})
    for module in (runtime, hooks, handle, views):
        monkeypatch.setitem(sys.modules, module.__name__, module)
    write_files(files, tmp_path / "out")
    monkeypatch.syspath_prepend(str(tmp_path / "out" / "rover_managers"))
    importlib.invalidate_caches()
    yield lambda name: importlib.import_module(f"rover_managers.{name}")
    for name in [name for name in sys.modules if name.split(".")[0] == "rover_managers"]:
        del sys.modules[name]


def test_the_model_in_the_package(generated, robot_folder):
    module = generated("model")
    assert load_robot(robot_folder).skillsets == (module.SKILLSET,)
    assert json.loads(module.MODEL_JSON)["name"] == "rover"
    assert module.DATA_TOPICS == {"battery": ("/battery", "sensor_msgs/msg/BatteryState"), "height": ("/height", "std_msgs/msg/Float64")}


def test_inputs(generated):
    module = generated("inputs")
    inputs = module.GoToInputs(target=1, via=[], fast=True, tries=3, label="x")
    assert (inputs.target, inputs.tries) == (1, 3)
    with pytest.raises(AttributeError):
        inputs.tries = 4
    with pytest.raises(TypeError):
        module.GoToInputs(target=1)
    assert module.GoToInputs.__annotations__["via"] == "list[geometry_msgs.msg.Point]"
    module.WaitInputs()


def test_hooks(generated):
    module = generated("hooks")
    with pytest.raises(TypeError, match="abstract"):
        module.AbstractGoToSkill()

    class GoTo(module.AbstractGoToSkill):
        def on_dispatch(self, execution):
            self.terminated_ARRIVED(execution, "there", travelled=2.0, seen=[])

        def on_interrupt(self, execution):
            self.terminated_STUCK(execution, travelled=1.0, seen=[])

    hooks, execution = GoTo(), Execution()
    assert hooks.validate(None) == ""
    assert hooks.progress(execution) == 0.125
    assert (GoTo.skill, GoTo.inputs_type) == ("go_to", generated("inputs").GoToInputs)
    hooks.on_dispatch(execution)
    assert execution.ended == ("ARRIVED", "there", {"travelled": 2.0, "seen": []})
    hooks.on_interrupt(execution)
    assert execution.ended == ("STUCK", "", {"travelled": 1.0, "seen": []})
    with pytest.raises(TypeError):
        hooks.terminated_STUCK(execution)
    assert set(module.ABSTRACT_HOOKS) == {"go_to", "wait"}


def test_the_client(generated):
    module = generated("client")
    rover = module.RoverClient("client")
    started = rover.go_to(target=1, via=[], fast=False, tries=2, label="x")
    assert started == ("go_to", {"target": 1, "via": [], "fast": False, "tries": 2, "label": "x"})
    assert rover.wait() == ("wait", {})
    with pytest.raises(TypeError):
        rover.go_to(1, [], False, 2, "x")
    assert (rover.client, rover.drive.made, rover.data.battery.made) == ("client", ("client", "drive"), ("client", "battery"))
    assert module.GoToResult.__args__ == ("ARRIVED", "STUCK")
    assert module.DriveState.__args__ == ("FREE", "USED")
    assert list(module.GoToOutputs.__annotations__) == ["travelled", "seen"]
    said = module.GoToSkill.__call__.__doc__
    assert "tries: uint8\n" in said
    assert "target: geometry_msgs/Point, where 'to', a/b" in said
    assert "STUCK, wheels 'spin'\n" in said


AWKWARD = """skillset odd {
  resource class { initial client client -> data }
  resource go { initial A A -> B }
  skill go { result { R } }
  skill client { result { %s } }
  skill long { input { %s } result { DONE } }
}
"""


def test_names_that_python_or_the_client_needs(tmp_path):
    folder = tmp_path / "My-Robot 2"
    folder.mkdir()
    many = " ".join(f"RESULT_NUMBER_{number}" for number in range(12))
    inputs = " ".join(f"a_rather_long_input_{number}: float64" for number in range(9))
    (folder / "odd.skill").write_text(AWKWARD % (many, inputs))
    files = robot_files(load_robot(folder))
    code = files["odd_managers/odd_managers/client.py"]
    ast.parse(code)
    members = [line.split(" = ")[0].split(":")[0].strip() for line in code.splitlines() if line.startswith("        self.")]
    assert members == ["self.data", "self.go", "self.client_", "self.long", "self.class_", "self.go_"]
    assert "class MyRobot2(RobotClient):" in files["my_robot_2_client/my_robot_2_client/robot.py"]
    assert_formatted(files, tmp_path)


def assert_formatted(files, tmp_path):
    ruff = shutil.which("ruff")
    if ruff is None:
        pytest.skip("ruff is not installed here")
    write_files(files, tmp_path / "out")
    done = subprocess.run(
        [ruff, "format", "--isolated", "--line-length", "140", "--diff", str(tmp_path / "out")], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout


def test_generated_python_is_formatted(files, tmp_path):
    assert_formatted(files, tmp_path)
