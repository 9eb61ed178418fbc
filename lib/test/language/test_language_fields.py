"""Fields of data in the conditions of a robot's models, held against the messages of its packages."""

from __future__ import annotations

import pytest

from alula.cli import check
from alula_testing.battery import make_robot

MODEL = """
type Battery
skillset rover {
  data battery: Battery period 1 sec
  skill drive { precondition p: %s success ok }
}
"""


@pytest.fixture
def robot(tmp_path):
    return make_robot(tmp_path)


@pytest.mark.parametrize(
    ("condition", "said"),
    [
        ("battery.level > 0.2", ""),
        ("battery.first.volts > 3", ""),
        ('battery.maker == "none"', ""),
        ("battery.charging == true", ""),
        ("battery.other.anything > 3", ""),
        ("battery.lvel > 0.2", "data `battery.lvel`: rover_msgs/Battery has no field `lvel`"),
        ("battery.first.amps > 0.2", "rover_msgs/Cell has no field `amps`"),
        ("battery.level.value > 0.2", "float64 has no fields"),
        ("battery.first > 0.2", "data `battery.first` is a rover_msgs/Cell, no single value"),
        ("battery > 0.2", "data `battery` is a rover_msgs/Battery, no single value"),
        ('battery.level == "full"', "data `battery.level` is a float64 and can't be compared with 'full'"),
        ("battery.maker == 3", "data `battery.maker` is a string and can't be compared with 3.0"),
        ("battery.charging == 1", "is a bool and can't be compared with 1.0"),
    ],
)
def test_a_condition_names_a_field_of_the_message(robot, condition, said, capsys):
    model = robot / "skillsets/rover.rl"
    model.write_text(MODEL % condition, encoding="utf-8")
    assert check.main([str(model), "--no-proofs"]) == (1 if said else 0)
    out = capsys.readouterr().out
    assert said in out
    assert ("ALU214" in out) is bool(said)
    if said:
        assert "rover.rl:5:" in out


def test_a_model_that_lies_elsewhere_is_not_held_against_messages_of_others(robot, tmp_path):
    model = tmp_path / "elsewhere.rl"
    model.write_text(MODEL % "battery.lvel > 0.2", encoding="utf-8")
    assert check.main([str(model), "--no-proofs"]) == 0
