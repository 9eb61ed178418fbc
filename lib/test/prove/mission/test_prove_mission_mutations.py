"""The mutation study: what it says of altered missions is so, and of a seeded few of the drone's none is missed."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import own_nodes
import pytest

from alula.campaign.plan import load_campaign
from alula.common.robots import find_robot
from alula.language.models import ModelFile, check_texts
from alula.missions.director import Outcome
from alula.missions.mission_file import MissionFile, plan_of_file
from alula.missions.mocked import MockedMission
from alula.missions.part import NO_PART, MissionPart
from alula.mock import Behaviour
from alula.model.model import Skillset
from alula.prove.mission.prover import LOOKED_AT
from alula.prove.mission.state import State
from alula.prove.mission.system import System
from alula.runtime.core.events import ExecutionEvent
from alula.trees.node import SyncAction, register
from alula.trees.ports import output_port
from alula.trees.status import Answer
from alula.trees.values import INT
from finding_pages.mission_checks import whole
from finding_pages.mission_proofs import ROBOT
from mission_mutations import __main__ as study
from mission_mutations import models, trees
from mission_mutations.classes import CLASS_ALTERED
from mission_mutations.flights import NOTHING, OTHERWISE, REFUSED, WRONG, Flights
from mission_mutations.judging import ACCOUNT, ANOTHER_RUN, ANSWERS, EQUAL, FOUND, MISSED, Judge, Robot, Verdict
from mission_mutations.mutants import KINDS, Mutant, chosen, mutants_of
from mission_mutations.study import Study
from mission_mutations.trees import OWN_DROPPED

ROOT = find_robot(Path(__file__)).root
(DRONE,) = check_texts([ModelFile("robot.rl", ROBOT)])[0].skillsets
GOOD = """<Fallback>
  <Sequence><drone.lift/><Parallel success_count="1" failure_count="1"><drone.hover/><AlwaysSuccess/></Parallel></Sequence>
  <RetryUntilSuccessful num_attempts="2"><drone.land/></RetryUntilSuccessful>
  <AlwaysFailure/>
</Fallback>"""
TWO_WAYS = """<Fallback>
  <drone.hover outcome="{how}"/>
  <Sequence><ScriptCondition code="how == 'ABORTED'"/><drone.lift/></Sequence>
  <drone.land/>
</Fallback>"""
COUNTS = """<Sequence>
  <Script code="rounds := 0"/>
  <Until if="rounds &gt;= 3">
    <Sequence><ForceSuccess><drone.hover/></ForceSuccess><Script name="one more" code="rounds += 1"/></Sequence>
  </Until>
</Sequence>"""


def judge_of(folder: Path, text: str) -> Judge:
    (folder / "example.xml").write_text(whole(text))
    return Judge(Robot(folder, (DRONE,), NO_PART, {}), "example")


def verdict(folder: Path, before: str, after: str) -> Verdict:
    return judge_of(folder, before).judge(Mutant("example", "by hand", "", "example.xml", whole(after)))


def test_what_is_not_given_back_is_found_and_flies(tmp_path: Path) -> None:
    judge = judge_of(tmp_path, GOOD)
    what, model = next((what, model) for _, what, model in models.altered(DRONE, ["lift"]) if "broken" in what)
    one = judge.judge(Mutant("example", "by hand", what, skillset=model))
    assert (one.verdict, one.by, one.flown) == (FOUND, "ALU701", True)


def test_another_answer_is_found_beside_the_original_and_a_flight_tells_them_apart(tmp_path: Path) -> None:
    skills = ("<drone.lift/>", "<drone.hover/>")
    one = verdict(tmp_path, *(f"<Fallback>{first}{then}<drone.land/></Fallback>" for first, then in (skills, skills[::-1])))
    assert (one.verdict, one.by, one.flown) == (FOUND, ANSWERS, True)


def test_what_does_the_same_is_equal(tmp_path: Path) -> None:
    never = TWO_WAYS.replace("<drone.land/>", "<ForceSuccess><drone.land/></ForceSuccess>")
    assert (
        verdict(tmp_path, never, never.replace("<drone.lift/></Sequence>", "<Sequence><drone.lift/></Sequence></Sequence>")).verdict
        == EQUAL
    )


def test_numbers_that_the_search_does_not_know_are_not_said_to_be_equal(tmp_path: Path) -> None:
    for before, after in (("rounds += 1", "rounds += 2"), ("rounds := 0", "rounds := 1"), ("rounds &gt;= 3", "!(rounds &gt;= 3)")):
        assert verdict(tmp_path, COUNTS, COUNTS.replace(before, after)).verdict != EQUAL, after


@register("robot.Wishes")
class Wishes(SyncAction):
    """A node of a robot's own that says how many rounds there are."""

    ports = (output_port("rounds", INT),)

    def update(self) -> Answer:
        """Not asked: the search sees its ports."""
        raise NotImplementedError


ROUNDS = """<Sequence>
  <Script code="rounds := 0"/>
  <robot.Wishes rounds="{wanted}"/>
  <AlwaysSuccess _skipIf="rounds &gt; wanted"/>
  <Until if="rounds &gt;= wanted">
    <Sequence><Fallback><drone.hover/><drone.land/></Fallback><Script code="rounds += 1"/></Sequence>
  </Until>
</Sequence>"""


def test_rounds_by_a_number_of_the_world_are_told_from_one_round_by_a_flight(tmp_path: Path) -> None:
    """The flight counts: it meets 1 where the search has met a number that it did not know."""
    (tmp_path / "example.xml").write_text(whole(ROUNDS))
    judge = Judge(Robot(tmp_path, (DRONE,), MissionPart((Wishes,)), {}), "example")
    once = next(text for kind, _, text in trees.altered(whole(ROUNDS)) if kind == trees.RETRY_DROPPED)
    one = judge.judge(Mutant("example", "by hand", "", "example.xml", once))
    assert (one.verdict, one.by, one.flown) == (FOUND, ANOTHER_RUN, True), one


def test_what_is_written_again_is_equal_where_it_is_a_value_of_the_file(tmp_path: Path) -> None:
    one, again = (f'<{tag}><Script code="stopping := true"/><drone.land/></{tag}>' for tag in ("Sequence", "ReactiveSequence"))
    assert verdict(tmp_path, *(TWO_WAYS.replace("<drone.land/>", last) for last in (one, again))).verdict == EQUAL


COUNTED = whole("""<Fallback>
  <Sequence><drone.hover/><Script name="one more" code="rounds += 1"/></Sequence>
  <ForceFailure><drone.land/></ForceFailure>
</Fallback>""").replace(
    "</root>", '<TreeNodesModel><SubTree ID="mission"><output_port name="rounds" default="0"/></SubTree></TreeNodesModel></root>'
)


def test_a_round_that_is_counted_before_it_is_done_is_told_by_the_missions_account(tmp_path: Path) -> None:
    """Both ask for the same and end alike; of a hover that is aborted one of them says that it was a round."""
    (tmp_path / "example.xml").write_text(COUNTED)
    judge = Judge(Robot(tmp_path, (DRONE,), NO_PART, {}), "example")
    swapped = next(text for kind, what, text in trees.altered(COUNTED) if kind == trees.CHILDREN_SWAPPED and "'Sequence'" in what)
    one = judge.judge(Mutant("example", "by hand", "", "example.xml", swapped))
    assert (one.verdict, one.by, one.flown) == (FOUND, ACCOUNT, True), one
    assert "'rounds': 0.0} becomes" in one.told


SENSES = """
skillset drone {
  resource control { state { OURS THEIRS } initial OURS transition { extern OURS -> THEIRS  extern THEIRS -> OURS } }
  skill see { progress 0.5  invariant { ours { guard control == OURS } }  success DONE }
  skill hear { progress 0.5  invariant { ours { guard control == OURS } }  success DONE }
  skill land { success DONE }
}
"""
SENSING = """<Fallback>
  <Parallel success_count="1" failure_count="1">
    <drone.see/>
    <drone.hear/>
    <Sequence>
      <WaitFor name="it sees" if="progress(drone.see) &gt;= 1"/>
      <WaitFor name="it hears" if="progress(drone.hear) &gt;= 1"/>
    </Sequence>
  </Parallel>
  <drone.land/>
</Fallback>"""


def test_what_is_waited_for_in_another_order_is_told_apart_where_it_may_be_over_again(tmp_path: Path) -> None:
    """One of both asks a question that the other does not ask there; the flight of both is told the answer that tells them apart."""
    (senses,) = check_texts([ModelFile("robot.rl", SENSES)])[0].skillsets
    (tmp_path / "example.xml").write_text(whole(SENSING))
    judge = Judge(Robot(tmp_path, (senses,), NO_PART, {}), "example")
    swapped = next(text for kind, what, text in trees.altered(whole(SENSING)) if kind == trees.CHILDREN_SWAPPED and "'Sequence'" in what)
    one = judge.judge(Mutant("example", "by hand", "", "example.xml", swapped))
    assert (one.verdict, one.by, one.flown) == (FOUND, ANOTHER_RUN, True), one


NEEDING = whole("""<root BTCPP_format="4" main_tree_to_execute="mission">
<BehaviorTree ID="mission"><Fallback><drone.hover/><drone.land/></Fallback></BehaviorTree>
<BehaviorTree ID="ready"><Sequence>
  <Needs name="ours" if="drone.control == OURS" otherwise="'it is theirs'"/>
  <Needs name="free" if="drone.axes == FREE" otherwise="'it is taken'"/>
</Sequence></BehaviorTree></root>""")


def test_what_is_needed_may_stand_in_any_order_and_no_word_of_it_may_change(tmp_path: Path) -> None:
    (tmp_path / "example.xml").write_text(NEEDING)
    judge = Judge(Robot(tmp_path, (DRONE,), NO_PART, {}), "example")
    swapped = next(text for kind, what, text in trees.altered(NEEDING) if kind == trees.CHILDREN_SWAPPED and "ready" in what)
    assert judge.judge(Mutant("example", "by hand", "", "example.xml", swapped)).verdict == EQUAL
    other = NEEDING.replace("it is theirs", "nobody knows")
    assert judge.judge(Mutant("example", "by hand", "", "example.xml", other)).verdict != EQUAL


EITHER = """<Fallback>
  <Sequence>
    <drone.lift/>
    <ForceSuccess><Parallel success_count="1" failure_count="1">
      <Awaits name="it is theirs" if="drone.control == THEIRS" within="9" for="3"/>
      <Awaits name="it is ours" if="drone.control == OURS" within="9" for="3"/>
    </Parallel></ForceSuccess>
    <ForceSuccess><drone.hover/></ForceSuccess>
  </Sequence>
  <drone.land/>
</Fallback>"""


def test_one_may_ask_less_than_the_other_where_that_decides_nothing(tmp_path: Path) -> None:
    """What stands first in a Parallel may end it, and the other is not asked any more."""
    judge = judge_of(tmp_path, EITHER)
    swapped = next(text for kind, what, text in trees.altered(whole(EITHER)) if kind == trees.CHILDREN_SWAPPED and "'Parallel'" in what)
    assert judge.judge(Mutant("example", "by hand", "", "example.xml", swapped)).verdict == EQUAL


SOONER = EITHER.replace('THEIRS" within="9"', 'THEIRS" within="4"')
LATER = EITHER.replace('<Awaits name="it is ours"', '<Sequence><Sleep msec="2000"/><Awaits name="it is ours"').replace(
    "</Parallel>", "</Sequence></Parallel>"
)


def courses(folder: Path, text: str) -> list[list[object]]:
    """Return what happens, and when, in flights in which control is given and taken, last at another moment in each."""
    (folder / "flown.xml").write_text(text)
    plan = plan_of_file(folder / "flown.xml", "flown", (DRONE,), {}, NO_PART)
    found = []
    for last_s in (6.7, 7.3, 7.9, 8.5, 9.1, 9.7, 10.3):
        mission = MockedMission((DRONE,), Behaviour(), plan)
        for number, at_s in enumerate((1.5, 3.5, 5.5, last_s)):
            change = partial(mission.world.managers["drone"].transition, "control", ("THEIRS", "OURS")[number % 2])
            mission.world.clock.after(at_s, change)
        assert mission.run().outcome in {Outcome.ACCOMPLISHED, Outcome.GIVEN_UP}
        found.append([(one.stamp_ns, one.skill, one.state) for one in mission.events if isinstance(one, ExecutionEvent)])
    return found


@pytest.mark.parametrize(("before", "equal"), [(EITHER, True), (SOONER, False), (LATER, False)], ids=["at once", "sooner", "later"])
def test_waits_of_one_length_that_begin_at_once_are_over_at_once(before: str, equal: bool, tmp_path: Path) -> None:  # noqa: FBT001
    """So a Parallel that ends when one of them fails does what one does that ends when both fail; flights by the clock show the same."""
    judge = judge_of(tmp_path, before)
    both = next(text for kind, what, text in trees.altered(whole(before)) if kind == trees.POLICY_CHANGED and "failure_count" in what)
    one = judge.judge(Mutant("example", "by hand", "", "example.xml", both))
    assert (one.verdict, one.flown) == ((EQUAL, None) if equal else (FOUND, True)), one
    assert (courses(tmp_path, whole(before)) == courses(tmp_path, both)) is equal


def observed(folder: Path, text: str, skillset: Skillset, part: MissionPart) -> set[object]:
    """Return all that can be seen of a mission's situations, one looked at after another."""
    (folder / "seen.xml").write_text(text)
    system = System.of(MissionFile.read(folder / "seen.xml", (skillset,), part), LOOKED_AT)
    first = system.initial()
    known, todo = {first}, [first]
    while todo:
        for _, after in system.steps(todo.pop()):
            if after not in known:
                known.add(after)
                todo.append(after)
    return {_seen(system, state) for state in known}


def _seen(system: System, state: State) -> object:
    running = sorted((system.leaves[leaf].model.name, one.phase, one.asked) for leaf, one in system.open(state))
    return system.managers(state, "drone").states, tuple(running), system.outcome(state)


OWN = {
    "guard": """<Fallback>
      <robot.Guard><Fallback><drone.lift/><drone.hover/></Fallback></robot.Guard>
      <ForceFailure><drone.land/></ForceFailure>
    </Fallback>""",
    "rate limit": """<Fallback>
      <Timeout msec="2000"><robot.Limit><Fallback><drone.hover/><drone.lift/></Fallback></robot.Limit></Timeout>
      <drone.land/>
    </Fallback>""",
    "recovery": """<Fallback>
      <robot.Recovery tries="1"><drone.hover/><drone.lift/></robot.Recovery>
      <drone.land/>
    </Fallback>""",
    "round robin": """<Fallback>
      <RetryUntilSuccessful num_attempts="3"><robot.ByTurns><drone.lift/><drone.hover/></robot.ByTurns></RetryUntilSuccessful>
      <drone.land/>
    </Fallback>""",
    "anything": """<Fallback>
      <robot.Moody><drone.hover/></robot.Moody>
      <drone.land/>
    </Fallback>""",
}
"""Missions with nodes of a robot's own, of the kinds that robots have."""


def all_mutants(folder: Path) -> Iterator[Mutant]:
    used = {"drone": [skill.name for skill in DRONE.skills]}
    yield from mutants_of(folder / "example.xml", [folder / "example.xml"], [DRONE], used, own_nodes.PART)


@pytest.mark.parametrize("kind", OWN)
def test_no_fault_within_a_node_of_the_robots_own_is_missed(kind: str, tmp_path: Path) -> None:
    """Neither one below it, nor one of its class."""
    (tmp_path / "example.xml").write_text(whole(OWN[kind]))
    judge = Judge(Robot(tmp_path, (DRONE,), own_nodes.PART, {}), "example")
    verdicts = [judge.judge(one) for one in all_mutants(tmp_path) if one.skillset is None]
    assert (OWN_DROPPED in {one.kind for one in verdicts if one.verdict == FOUND}) is (kind != "guard")  # that does what its child does
    assert (CLASS_ALTERED in {one.kind for one in verdicts if one.verdict == FOUND}) is (kind != "anything")  # that stands for any class
    assert [one for one in verdicts if one.verdict not in {FOUND, EQUAL}] == []


@pytest.mark.parametrize("text", [GOOD, TWO_WAYS, *(OWN[kind] for kind in ("guard", "rate limit", "recovery"))])
def test_an_equal_mutant_shows_the_same_situations(text: str, tmp_path: Path) -> None:
    """Held against a search of one situation after another, which knows no regions."""
    (tmp_path / "example.xml").write_text(whole(text))
    judge = Judge(Robot(tmp_path, (DRONE,), own_nodes.PART, {}), "example")
    original = observed(tmp_path, whole(text), DRONE, own_nodes.PART)
    verdicts = []
    models_too = text not in OWN.values()
    for mutant in (one for one in all_mutants(tmp_path) if models_too or one.skillset is None):
        one = judge.judge(mutant)
        verdicts.append(one.verdict)
        if one.verdict == EQUAL:
            part = mutant.part_of(own_nodes.PART)
            assert observed(tmp_path, mutant.text or whole(text), mutant.skillset or DRONE, part) == original, one
    assert verdicts.count(EQUAL) > (3 if models_too else 0)
    assert verdicts.count(FOUND) > (10 if models_too else 3)


def test_each_kind_alters_what_it_says(tmp_path: Path) -> None:
    (tmp_path / "example.xml").write_text(
        whole(GOOD.replace("<drone.lift/>", '<robot.Guard><ForceSuccess><drone.lift _onFailure="a := 1"/></ForceSuccess></robot.Guard>', 1))
    )
    kinds = {one.kind for one in all_mutants(tmp_path)}
    assert kinds == set(KINDS)
    for one in all_mutants(tmp_path):
        assert one.text != (tmp_path / "example.xml").read_text()
        assert one.skillset != DRONE


def test_a_model_is_altered_at_one_place() -> None:
    for kind, what, mutant in models.altered(DRONE, ["hover"]):
        assert [skill.name for skill, old in zip(mutant.skills, DRONE.skills, strict=True) if skill != old] == ["hover"], (kind, what)
        assert replace(mutant, skills=DRONE.skills) == DRONE


def test_choice_is_by_the_seed_and_even() -> None:
    everything = [Mutant("m", kind, str(number)) for kind in KINDS for number in range(30)]
    several = 2 * len(KINDS)
    some = chosen(everything, several, seed=4)
    assert some == chosen(everything, several, seed=4) != chosen(everything, several, seed=5)
    assert all([one.kind for one in some].count(kind) == 2 for kind in KINDS)
    assert len(chosen(everything, 1000, seed=1)) == len(set(everything))


def test_a_study_goes_on_where_its_file_ends_and_judges_again_what_was_missed(tmp_path: Path) -> None:
    several = [Mutant("example", "by hand", str(number)) for number in range(4)]
    file = tmp_path / "told.json"
    told = [
        Verdict("example", "by hand", str(number), verdict, "", "", None, 0.0) for number, verdict in ((0, FOUND), (1, MISSED), (3, EQUAL))
    ]
    file.write_text(json.dumps({"seed": 0, "mutants": [one.as_dict() for one in told]}))
    found = Study(_judged_now, Verdict, file, 0).run(several, processes=1)
    assert [(one.what, one.verdict, one.by) for one in found] == [
        ("0", FOUND, ""),
        ("1", FOUND, "now"),
        ("2", FOUND, "now"),
        ("3", EQUAL, ""),
    ]
    assert [Verdict(**one) for one in json.loads(file.read_text())["mutants"]] == found


def _judged_now(mutant: Mutant) -> Verdict:
    return Verdict(mutant.mission, mutant.kind, mutant.what, FOUND, "now", "", None, 0.0)


def test_flights_of_a_campaign_see_what_is_wrong_and_what_is_otherwise() -> None:
    campaign = load_campaign(ROOT / "tests" / "campaigns" / "uav.yaml")
    flights = Flights(study.robot_of(ROOT), "mapping", replace(campaign, runs=campaign.runs[:24]))
    every = {one.what: one for one in study.mutants(ROOT, ["mapping"])}
    seen = {
        "mapping.xml, mapping: 'mapping mission': its first child stands in its place": WRONG,  # nothing lands it when it gives up
        "mapping.xml, zed_navigation: 'leg': children 2 and 3 are swapped": OTHERWISE,
        "mapping.xml, ready: 'Sequence': Sequence is Fallback": NOTHING,
    }
    for what, by in seen.items():
        one = flights.judge(every[what])
        assert (one.by, one.flights) == (by, one.first if by == WRONG else 12), one
    broken = flights.judge(replace(every["mapping.xml, ready: 'Sequence': Sequence is Fallback"], text="<root>"))
    assert broken.by == REFUSED


def test_no_two_mutants_of_the_drone_are_told_alike_among_those_that_are_studied() -> None:
    some = [(one.mission, one.kind, one.what) for one in chosen(list(study.mutants(ROOT, [])), 300, seed=0)]
    assert len(set(some)) == len(some)


@pytest.mark.long
@pytest.mark.timeout(0)  # 50 s of processor time: as long as the machine needs
def test_of_the_drones_a_seeded_mutant_of_each_kind_is_not_missed() -> None:
    kinds = set(KINDS) - {OWN_DROPPED, CLASS_ALTERED}  # the drone has no nodes of its own with children
    some = chosen(list(study.mutants(ROOT, ["inspection"])), len(kinds), seed=0)
    assert {one.kind for one in some} == kinds
    verdicts = [study.judged(ROOT, one) for one in some]
    study.judge_of.cache_clear()  # it has all runs of a mission
    assert all(one.verdict in {FOUND, EQUAL} for one in verdicts), verdicts
    assert all(one.flown for one in verdicts if one.by in {ANSWERS, ANOTHER_RUN, "ALU701", "ALU702", "ALU704", "property"}), verdicts
