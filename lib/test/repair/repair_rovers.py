"""A small rover with two pairs of eyes and a dock, and missions of it that give up where one of its skills could go on."""

from __future__ import annotations

from pathlib import Path

MODELS = """
skillset eyes {
  resource laser { initial OK  extern OK -> BROKEN  extern BROKEN -> OK }
  resource bumper { initial OK  extern OK -> STUCK  extern STUCK -> OK }
  skill scan { provides sight  progress = 0.2
    precondition { works: resource = (laser == OK) }  invariant { works: resource = (laser == OK) }  result { failure LOST } }
  skill feel { provides touch  progress = 0.2
    precondition { works: resource = (bumper == OK) }  invariant { works: resource = (bumper == OK) }  result { failure LOST } }
}
skillset base {
  resource wheels { initial FREE  FREE -> USED  USED -> FREE }
  resource place { initial DOCKED  extern DOCKED -> AWAY  extern AWAY -> DOCKED }
  resource pose { initial GOOD  extern GOOD -> LOST  extern LOST -> GOOD }
  skill drive { provides arrival  needs sight  input { to: int32 }
    effect { take: wheels -> USED  give: wheels -> FREE }
    precondition { free: resource = (wheels == FREE)  known: resource = (pose == GOOD)  success take }
    interrupt { apply = give }  result { success THERE: apply = give  failure BLOCKED: apply = give } }
  skill creep { provides arrival  needs touch  input { to: int32 }
    effect { take: wheels -> USED  give: wheels -> FREE }
    precondition { free: resource = (wheels == FREE)  success take }
    interrupt { apply = give }  result { success THERE: apply = give  failure BLOCKED: apply = give } }
  skill dock { needs sight  achieves resource = (place == DOCKED)
    effect { take: wheels -> USED  give: wheels -> FREE }
    precondition { free: resource = (wheels == FREE)  known: resource = (pose == GOOD)  success take }
    interrupt { apply = give }  result { success THERE: apply = give  failure BLOCKED: apply = give } }
  skill turn { achieves resource = (pose == GOOD)
    effect { take: wheels -> USED  give: wheels -> FREE }
    precondition { free: resource = (wheels == FREE)  success take }
    interrupt { apply = give }  result { success FOUND: apply = give  failure LOST: apply = give } }
}
skillset power {
  type Battery
  data battery: Battery period = 1.0
  resource charger { initial OFF  extern OFF -> ON  extern ON -> OFF }
  skill supply { progress = 0.2
    precondition { enough: data = (battery.percentage > 15 %) }
    invariant { enough: data = (battery.percentage > 15 %) }  result { failure EMPTY } }
  skill charge { achieves data = (battery.percentage > 60 %)
    precondition { contact: resource = (charger == ON) }  invariant { contact: resource = (charger == ON) }
    result { success FULL  failure OUT } }
}
"""
MOCKS = """
skills:
  base.drive: &away {delay: 2, result: THERE, then: [{after: 0.5, set: {base.place: AWAY, power.charger: "OFF"}}]}
  base.creep: *away
  base.dock: {delay: 2, result: THERE, then: [{after: 1.5, set: {base.place: DOCKED, power.charger: "ON"}}]}
  base.turn: {delay: 2, result: FOUND, then: [{after: 1.5, set: {base.pose: GOOD}}]}
  eyes.scan: {never: true, progress: 1}
  eyes.feel: {never: true, progress: 1}
  power.supply: {never: true, progress: 1}
  power.charge: {delay: 2, result: FULL}
faults:
  laser: {set: {eyes.laser: BROKEN}}
  battery: {ends: {power.supply: EMPTY}}
  person: {ends: {base.drive: BLOCKED}}
data:
  power.battery: {value: {percentage: 0.9}}
"""
FAULTS = """
faults:
  laser: {states: {eyes.laser: BROKEN}}
  dust: {states: {eyes.laser: BROKEN}, later: {eyes.bumper: STUCK}}
  lost: {states: {base.pose: LOST}}
  bumper: {states: {eyes.bumper: STUCK}}
  battery: {ends: {power.supply: EMPTY}}
  person: {ends: {base.drive: BLOCKED}}
"""
ERRAND = """<root BTCPP_format="4" main_tree_to_execute="errand">
  <BehaviorTree ID="errand">
    <Fallback name="errand">
      <Parallel name="drive with open eyes" success_count="1" failure_count="1">
        <eyes.scan name="scan"/>
        <Sequence name="with eyes">
          <WaitFor name="sees" if="progress(eyes.scan) &gt;= 1"/>
          <base.drive name="drive" to="{goal}"/>
        </Sequence>
      </Parallel>
      <AlwaysFailure name="given up"/>
    </Fallback>
  </BehaviorTree>
  <TreeNodesModel>
    <SubTree ID="errand"><input_port name="goal" default="1"/>PORTS</SubTree>
  </TreeNodesModel>
</root>
"""
ROUNDS = """<root BTCPP_format="4" main_tree_to_execute="rounds">
  <BehaviorTree ID="rounds">
    <Fallback name="rounds">
      <Parallel name="work" success_count="1" failure_count="1">
        <power.supply name="watch the battery"/>
        <eyes.scan name="scan"/>
        <base.drive name="drive" to="1"/>
      </Parallel>
      <AlwaysFailure name="given up"/>
    </Fallback>
  </BehaviorTree>
</root>
"""
LOOP = """<root BTCPP_format="4" main_tree_to_execute="loop">
  <BehaviorTree ID="loop">
    <Fallback name="loop">
      <Sequence name="all rounds">
        <Script name="none yet" code="done := 0; supplied := ''"/>
        <Until name="until one is done" if="done &gt;= 1">
          <Fallback name="work, or mend">
            <Parallel name="work" success_count="1" failure_count="1">
              <power.supply name="watch the battery" outcome="{supplied}"/>
              <eyes.scan name="scan"/>
              <Sequence name="round">
                <base.drive name="drive" to="1"/>
                <Script name="one more" code="done += 1"/>
              </Sequence>
            </Parallel>
            <AlwaysFailure name="nothing mends it"/>
          </Fallback>
        </Until>
      </Sequence>
      <AlwaysFailure name="given up"/>
    </Fallback>
  </BehaviorTree>
</root>
"""


def rover(folder: Path, mission: str) -> Path:
    """Write the rover into a folder; return its mission's file."""
    files = {
        "robot.yaml": "name: rover\nrest: base.wheels FREE\n",
        "skillsets/rover.skill": MODELS,
        "skillsets/types.yaml": "Battery: sensor_msgs/BatteryState\n",
        "skillsets/mock.yaml": MOCKS,
        "skillsets/faults.yaml": FAULTS,
        "missions/main.xml": mission,
    }
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    return folder / "missions/main.xml"
