"""What a robot says of its pages: read with its defaults, refused with file and line."""

from __future__ import annotations

import pytest

from alula.common.robot_page import USUAL_PAGE
from alula.common.robots import RobotError, load_robot_folder


def page_of(folder, text):
    (folder / "robot.yaml").write_text(f"name: rover\n{text}")
    return load_robot_folder(folder).page


def test_figures_and_cameras_have_units_and_digits(tmp_path):
    page = page_of(
        tmp_path,
        "page:\n  figures: {scan.share: {label: seen, unit: '%'}, scan.count: {label: scans, digits: 0}}\n"
        "  cameras:\n    front: {about: the way ahead, data: base.picture, figures: {bps: {label: rate, unit: kbit/s, factor: 0.001}}}\n"
        "  controller: base computer\n  mode: base.state.mode\n  links: [base.radio]\n",
    )
    assert page["figures"] == {
        "scan.share": {"label": "seen", "unit": "%", "digits": 1, "factor": 100.0},
        "scan.count": {"label": "scans", "unit": "", "digits": 0, "factor": 1.0},
    }
    rate = {"label": "rate", "unit": "kbit/s", "digits": 1, "factor": 0.001}
    assert page["cameras"] == {"front": {"about": "the way ahead", "data": "base.picture", "figures": {"bps": rate}}}
    assert (page["controller"], page["mode"], page["link"], page["links"]) == ("base computer", "base.state.mode", None, ["base.radio"])
    assert not page["flat"]
    (flat := tmp_path / "flat").mkdir()
    assert page_of(flat, "page: {flat: true}\n")["flat"]


def test_a_robot_that_says_nothing_has_the_usual_words(tmp_path):
    assert page_of(tmp_path, "") == USUAL_PAGE
    assert USUAL_PAGE["figures"] == USUAL_PAGE["cameras"] == {}


@pytest.mark.parametrize(
    ("said", "complaint"),
    [
        ("page:\n  figures: {a.b: {unit: m}}\n", r"robot.yaml:3: a figure needs `label`"),
        ("page:\n  cameras: {front: {data: a.b}}\n", r"robot.yaml:3: a camera needs `about`"),
        ("page:\n  charts: [[a]]\n", r"robot.yaml:3: an entry of `charts`"),
        ("page:\n  figures: {a.b: {label: x, digits: -1}}\n", r"robot.yaml:3: `digits` should be a number from 0 to 9"),
        ("page:\n  flat: 1\n", r"robot.yaml:3: `flat` should be true or false"),
        ("page:\n  chart: []\n", r"robot.yaml:3: `page` has no `chart`"),
    ],
)
def test_what_makes_no_sense_is_refused_with_its_place(tmp_path, said, complaint):
    with pytest.raises(RobotError, match=complaint):
        page_of(tmp_path, said)
