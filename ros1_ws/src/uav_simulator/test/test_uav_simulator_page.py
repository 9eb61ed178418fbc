"""The README's tables are what the code says."""

from uav_simulator.page import PAGE, page
from uav_simulator.sensors.faults import SensorMode


def test_the_tables_are_current() -> None:
    text = PAGE.read_text(encoding="utf-8")
    assert text == page(text), "write them again: setup/in_ros1 python -m uav_simulator.page"


def test_every_way_to_fail_is_explained() -> None:
    text = page("")
    assert [mode.value for mode in SensorMode if f"| `{mode.value}` | " not in text] == ["ok"]
