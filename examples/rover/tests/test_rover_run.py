from __future__ import annotations

import re
from pathlib import Path

from alula import parts

ROOT = Path(__file__).resolve().parents[1]
NODE = re.compile(r"<node\s[^>]*?>")


def test_a_run_ends_with_each_process_of_the_layer_that_is_not_started_again():
    """Also a node that is renamed, or no longer started again, needs an answer."""
    launch = (ROOT / "ros1_ws/src/rover_navigation/launch/functional.launch").read_text(encoding="utf-8")
    nodes = NODE.findall(launch)
    once = {re.search(r'\bname="(\w+)"', node)[1] for node in nodes if 'respawn="true"' not in node}
    assert len(nodes) > len(once) > 0
    assert once == {name for name, means in parts.load_part("run", ROOT)().consequences.items() if means is parts.Consequence.END}
