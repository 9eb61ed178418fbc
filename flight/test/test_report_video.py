"""What the report says of the radio that ended a flight's video."""

from __future__ import annotations

import pytest

from alula_flight.report.phases import Phases
from alula_flight.report.video import RadioState, Video, radio_lost_s

LIFT_OFF_S = 100.0


@pytest.mark.parametrize(
    ("states", "lost_s"),
    [
        ([("good", -5.0), ("critical", 17.0)], 117.0),
        ([("good", -5.0), ("degraded", 8.0), ("critical", 17.0), ("out", 20.0), ("critical", 21.0)], 117.0),
        ([("good", -5.0), ("critical", 10.0), ("good", 12.0), ("out", 18.0)], 118.0),
        ([("good", -5.0), ("critical", 10.0), ("good", 12.0)], None),
        ([("good", -5.0), ("critical", 30.0)], None),
        ([], None),
    ],
)
def test_the_radio_was_lost_when_it_became_as_bad_as_it_was_in_the_end(states, lost_s):
    radio = tuple(RadioState(t_s, quality, "", 0.0) for quality, t_s in states)
    video = Video(radio=radio, end_s=22.0, criterion="enough_frames")
    assert radio_lost_s(video, Phases(zero_s=LIFT_OFF_S, zero_from="simulator")) == lost_s


def test_a_stream_that_no_criterion_ended_lost_no_radio():
    assert radio_lost_s(Video(radio=(RadioState(1.0, "out", "", 0.0),), end_s=22.0), Phases()) is None
