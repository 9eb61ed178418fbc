"""The README's table of parameters is what the settings say."""

from perception_core.tunable import ranges
from uav_guidance.page import PAGE, page
from uav_guidance.settings import GuidanceSettings


def test_the_table_is_current() -> None:
    text = PAGE.read_text(encoding="utf-8")
    assert text == page(text), "write it again: setup/in_ros1 python -m uav_guidance.page"


def test_every_parameter_that_may_be_changed_is_in_it() -> None:
    text = page("")
    assert [name for name in ranges(GuidanceSettings) if f"| `~{name}` | " not in text] == []
