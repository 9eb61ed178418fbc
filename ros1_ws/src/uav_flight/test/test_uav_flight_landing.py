"""The supervisor's own landing, over a guidance that a test plays."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from uav_flight import landing
from uav_flight.landing import Landing
from uav_flight.part import DronePart


class Guidance:
    """Stands for the guidance's topic and service; it lands at the first request that it accepts."""

    def __init__(self, *refusals):
        self.refusals = list(refusals)
        self.asked = 0
        self.hear = lambda _: None

    def subscribe(self, topic, _kind, callback, queue_size):
        assert (topic, queue_size) == ("/uav_guidance/state", 1)
        self.hear = callback
        self.say()

    def say(self, **changes):
        self.hear(SimpleNamespace(**{"authority": True, "reference": "hover", "armed": True, **changes}))

    def request(self):
        self.asked += 1
        if self.refusals:
            answer = self.refusals.pop(0)
            if isinstance(answer, Exception):
                raise answer
            return SimpleNamespace(accepted=False, reason=answer)
        self.say(reference="land", armed=False)
        return SimpleNamespace(accepted=True, reason="")


class ServiceError(Exception):
    """As rospy's."""


@pytest.fixture
def over(monkeypatch):
    """Return what makes a landing over a guidance."""
    monkeypatch.setattr(landing, "AGAIN_S", 0.0)
    monkeypatch.setattr(landing, "STATE_TIMEOUT_S", 0.0)

    def make(guidance):
        ros = SimpleNamespace(
            Subscriber=guidance.subscribe,
            wait_for_service=lambda *_, **__: None,
            ServiceProxy=lambda *_: guidance.request,
            ROSException=ServiceError,
            ServiceException=ServiceError,
        )
        monkeypatch.setattr(landing, "rospy", ros)
        return Landing(SimpleNamespace(now_s=30.0, simulated=False, stands_still=False))

    return make


def test_it_lands_what_is_ours(over):
    guidance = Guidance()
    own = over(guidance)
    own.land()
    assert (guidance.asked, own.refused) == (1, "")


@pytest.mark.parametrize(
    ("answer", "told"),
    [
        ("the vehicle is taking off", "the guidance refuses to: the vehicle is taking off"),
        (ServiceError("no answer"), "the guidance could not be told to: no answer"),
    ],
)
def test_what_is_refused_is_asked_for_again_and_told(over, answer, told):
    guidance = Guidance(answer)
    own = over(guidance)
    said = []
    ask = guidance.request
    guidance.request = lambda: (said.append(own.refused), ask())[1]
    landing.rospy.ServiceProxy = lambda *_: guidance.request
    own.land()
    assert (guidance.asked, said, own.refused) == (2, ["", told], "")


@pytest.mark.parametrize("state", [{"authority": False}, {"armed": False}], ids=["somebody else's", "down"])
def test_what_is_not_ours_or_down_is_left_alone(over, state):
    guidance = Guidance()
    own = over(guidance)
    guidance.say(**state)
    own.land()
    assert guidance.asked == 0


def test_a_guidance_that_says_nothing_is_not_waited_for_without_end(over):
    guidance = Guidance()
    guidance.subscribe = lambda *_, **__: None
    over(guidance).land()
    assert guidance.asked == 0


def told(**changes):
    state = {"link": True, "authority": True, "armed": True, "landed_state": 4, "mode": "LAND", **changes}
    return SimpleNamespace(position_enu_m=SimpleNamespace(z=2.24), **state)


@pytest.mark.parametrize(
    ("state", "now_s", "refused", "words"),
    [
        (told(), 30.5, "", "the vehicle is being landed: in LAND, at 2.2 m"),
        (told(landed_state=1), 30.5, "", "the vehicle is being landed: on the ground with its motors on, in LAND"),
        (told(mode="GUIDED", landed_state=2), 30.5, "refused", "the vehicle is being landed: in GUIDED, at 2.2 m; refused"),
        (told(armed=False, landed_state=1), 30.5, "", ""),
        (told(), 36.0, "", "the vehicle is to be landed: nothing is heard of the guidance"),
        (None, 30.5, "", "the vehicle is to be landed: nothing is heard of the guidance"),
    ],
)
def test_how_the_vehicle_is_that_is_being_landed_is_told(state, now_s, refused, words):
    part = DronePart()
    part._guidance, part._landing = state, SimpleNamespace(refused=refused)
    part.resting(SimpleNamespace(now_s=30.0))
    assert part.resting(SimpleNamespace(now_s=now_s)) == words
