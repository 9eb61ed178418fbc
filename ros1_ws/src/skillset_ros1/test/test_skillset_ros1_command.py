"""``python -m skillset_ros1`` as the README has it, and what it says of wrong words."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from skillset_ros1_bench import SOON_S

from skillset_ros1.__main__ import main

README = Path(__file__).parents[1] / "README.md"


def test_the_readme_serves_and_calls_a_skillset(ros_master, tmp_path):
    text = README.read_text(encoding="utf-8")
    hooks, caller = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    (tmp_path / "my_hooks.py").write_text(hooks, encoding="utf-8")
    command = re.search(r"^    python (-m skillset_ros1 .*?)  +#", text, re.MULTILINE)[1]
    process = subprocess.Popen([sys.executable, *command.split()], cwd=tmp_path)
    try:
        called = subprocess.run([sys.executable, "-c", caller], capture_output=True, text=True, timeout=120, check=False)
        said = called.stdout.strip().splitlines()
        assert said, called.stderr
        assert all(f"    {line}\n" in text for line in said), said
        process.send_signal(signal.SIGINT)
        assert process.wait(SOON_S) == 0
    finally:
        process.kill()
        process.wait()


@pytest.mark.parametrize(
    ("words", "error"),
    [
        (["wings", "--hooks", "a:b"], "there is no skillset wings: generate and build it first"),
        (["perception", "--hooks", "hooks"], "--hooks hooks: a module and a function are wanted, as my_robot.navigation:make_hooks"),
        (["perception", "--hooks", "nothing.here:f"], "--hooks nothing.here:f: there is no module nothing.here on the PYTHONPATH"),
        (["perception", "--hooks", "json:nothing"], "--hooks json:nothing: json has no function nothing"),
    ],
)
def test_what_is_not_there_is_told(capsys, words, error):
    assert main(words) == 2
    assert capsys.readouterr().err == f"skillset_ros1: {error}\n"
