"""The manual's page of the nodes' parameters is what their settings are."""

from dataclasses import fields

from uav_flight.parameter_page import NODES, PAGE, page


def test_the_page_is_current() -> None:
    text = PAGE.read_text(encoding="utf-8")
    assert text == page(text), "write it again: setup/in_ros1 python -m uav_flight.parameter_page"


def test_every_parameter_is_in_it_with_what_it_is() -> None:
    rows = [row.split(" | ") for row in page("").splitlines() if row.startswith("| `~")]
    assert len(rows) == sum(len(fields(settings)) for settings in NODES.values())
    assert [row[0] for row in rows if not row[-1].strip(" |")] == []
