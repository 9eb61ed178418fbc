"""A robot that the tests of the generator generate from: every kind of input, comments that could break a generated file."""

from __future__ import annotations

SKILL = """skillset rover {
  type Point
  type Path
  data battery: Battery period = 1
  type Battery
  data height: float64
  resource drive { initial FREE FREE -> USED USED -> FREE }
  skill go_to {
    progress = 0.25
    input {
      target: Point // where "to", a\\b é */ $x ''' """
SKILL += '"""\n'
SKILL += """      via: Path
      fast: bool
      tries: uint8
      label: string
    }
    output { travelled: float64 seen: Path }
    effect { take: drive -> USED give: drive -> FREE }
    precondition { charged: data = (battery.percentage > 0.2) success take }
    invariant { driving: resource = (drive == USED) }
    interrupt { apply = give }
    result { ARRIVED: apply = give
      STUCK: apply = give // wheels "spin"
    }
  }
  skill wait { result { DONE } }
}
"""
TYPES = "Point: geometry_msgs/Point\nPath: geometry_msgs/msg/Point[]\nBattery: sensor_msgs/BatteryState\n"
BINDINGS = """
data:
  rover.battery: {topic: /battery, latched: true, depth: 3}
  rover.height: /height
topics:
  - {name: /clock, direction: ros1_to_ros2, type: rosgraph_msgs/Clock}
  - {name: /out, direction: ros2_to_ros1, type: std_msgs/Header, ros1_name: /other, reliability: best_effort}
services:
  - {name: /drive, server: ros1, type: std_srvs/SetBool, timeout_s: 2}
actions:
  - {name: /move_base, server: ros1, type: move_base_msgs/MoveBase, ros2_name: /go}
"""
