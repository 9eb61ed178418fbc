"""A node of one's own: a class with ports, by its name in the mission's file.

It prints:

    unknown before it is given: go.xml:4:7: unknown node 'arm.Heavier'
    accomplished: pick, place with 8 N
"""

from __future__ import annotations

import tempfile
from pathlib import Path

from alula import AlulaError, Mission, load_behaviour, load_skillset
from alula.trees import DOUBLE, SUCCESS, Answer, SyncAction, input_port, output_port, register

ARM = Path(__file__).parent / "arm"
TREE = """<root BTCPP_format="4" main_tree_to_execute="go">
  <BehaviorTree ID="go">
    <Sequence>
      <arm.Heavier force="5" factor="1.6" result="{force_n}"/>
      <arm.pick/>
      <arm.place force="{force_n}"/>
    </Sequence>
  </BehaviorTree>
</root>
"""


@register("arm.Heavier")
class Heavier(SyncAction):
    """Writes a force times a factor."""

    ports = (input_port("force", DOUBLE, unit="N"), input_port("factor", DOUBLE, "2"), output_port("result", DOUBLE, unit="N"))

    def update(self) -> Answer:
        """Do all of it in one tick."""
        self.put("result", self.real("force") * self.real("factor"))
        return SUCCESS


skillset = load_skillset(ARM / "skillsets/arm.skill")
behaviour = load_behaviour([ARM / "skillsets/mock.yaml"], [skillset])
with tempfile.TemporaryDirectory() as folder:
    file = Path(folder) / "go.xml"
    file.write_text(TREE, encoding="utf-8")
    try:
        Mission.from_file(file, [skillset])
    except AlulaError as error:
        print("unknown before it is given:", str(error).rpartition("/")[2].partition(";")[0])
    run = Mission.from_file(file, [skillset], behaviour=behaviour, nodes=[Heavier]).run()
forces = [one.inputs.force for one in run.executions if one.skill == "place"]
print(f"{run.outcome.value}: {', '.join(one.skill for one in run.executions)} with {forces[0]:g} N")
