"""Small random models that make sense to the checker: every name leads somewhere."""

from __future__ import annotations

from dataclasses import replace

from hypothesis import strategies as st

from alula.model.expressions import TRUE, And, Comparison, Constant, DataIs, Implies, Not, Or, ResourceIs, SkillRuns
from alula.model.model import (
    NO_EFFECT,
    Assignment,
    Data,
    Effect,
    Event,
    Hold,
    Interrupt,
    Invariant,
    Precondition,
    Progress,
    Property,
    PropertyKind,
    Resource,
    Result,
    ResultKind,
    Skill,
    Skillset,
    Transition,
)

RESOURCES = ("r", "q", "p")
SKILLS = ("f", "g", "h")
VALUES = (0.0, 1.0, 2.0)


def _resources(draw, most):
    made = []
    for name in RESOURCES[: draw(st.integers(1, most))]:
        states = ("A", "B", "C")[: draw(st.integers(2, 3))]
        transition = st.builds(Transition, st.sampled_from(states), st.sampled_from(states), st.booleans())
        transitions = draw(st.lists(transition, min_size=2, max_size=6, unique_by=lambda t: (t.source, t.target, t.extern)))
        made.append(Resource(name, states, states[0], tuple(transitions)))
    return tuple(made)


def atom(draw, resources):
    resource = draw(st.sampled_from(resources))
    return ResourceIs(resource.name, draw(st.sampled_from(resource.states)), draw(st.booleans()))


def condition(draw, leaf, depth=2):
    shape = draw(st.sampled_from(["leaf", "leaf", "leaf", "not", "and", "or", "implies", "constant"])) if depth else "leaf"
    if shape == "constant":
        return Constant(draw(st.booleans()))
    if shape == "not":
        return Not(condition(draw, leaf, depth - 1))
    if shape == "leaf":
        return leaf(draw)
    several = (condition(draw, leaf, depth - 1), condition(draw, leaf, depth - 1))
    return {"and": And, "or": Or}[shape](several) if shape != "implies" else Implies(*several)


def _effect(draw, resources, *, possible=False):
    """A change or two; with ``possible`` each to a state that some transition for skills leads to."""
    aims = {r.name: [t.target for t in r.transitions if not t.extern] if possible else r.states for r in resources}
    names = sorted(name for name, states in aims.items() if states)
    chosen = draw(st.lists(st.sampled_from(names), max_size=2, unique=draw(st.booleans()))) if names else []
    return Effect("", tuple(Assignment(name, draw(st.sampled_from(aims[name]))) for name in chosen)) if chosen else NO_EFFECT


def datum(draw):
    """An atom over one number; its threshold is one of the values that tests give."""
    comparison = draw(st.sampled_from([Comparison.LT, Comparison.LE, Comparison.GT, Comparison.GE, Comparison.EQ]))
    return DataIs("d", (), comparison, draw(st.sampled_from(VALUES)))


def _hold(draw, asked):
    """A hold for a condition, or none; recovery values go with a threshold and lie on its good side."""
    for_s = draw(st.sampled_from([0.0, 0.0, 1.0, 2.0]))
    good_side = {Comparison.LT: -1.0, Comparison.LE: -1.0, Comparison.GT: 1.0, Comparison.GE: 1.0}
    recovers = isinstance(asked, DataIs) and asked.comparison in good_side and draw(st.booleans())
    hysteresis = asked.value + good_side[asked.comparison] if recovers else None
    return Hold(for_s, hysteresis) if for_s or recovers else None


def _invariant(draw, name, asked, effect, timed):
    return Invariant(name, asked, effect, _hold(draw, asked) if timed else None)


def _progress(draw, timed):
    return Progress(0.1, deadline_s=draw(st.sampled_from([1.5, 3.0]))) if timed and draw(st.booleans()) else None


def _skill(draw, name, resources, timed):
    def asks(*, data=timed):
        return condition(draw, lambda d: datum(d) if data and d(st.booleans()) else atom(d, resources))

    def kept():
        return datum(draw) if timed and draw(st.booleans()) else asks()

    def does():
        return _effect(draw, resources, possible=timed)

    def post():
        return asks(data=False) if draw(st.booleans()) else TRUE

    kinds = st.sampled_from(ResultKind)
    return Skill(
        name=name,
        preconditions=tuple(Precondition(f"p{i}", asks()) for i in range(draw(st.integers(0, 1 if timed else 2)))),
        start=does(),
        invariants=tuple(_invariant(draw, f"i{i}", kept(), does(), timed) for i in range(draw(st.integers(int(timed), 2)))),
        progress=_progress(draw, timed),
        interrupt=Interrupt(effect=does(), postcondition=post()),
        results=tuple(Result(f"R{i}", draw(kinds), does(), post()) for i in range(draw(st.integers(1, 2)))),
    )


@st.composite
def skillsets(draw, *, most_resources=3, most_skills=3, properties=False, events=True, timed=False):
    """``timed`` models ask a number ``d``, wait, and have progress deadlines."""
    resources = _resources(draw, most_resources)
    skills = tuple(_skill(draw, name, resources, timed) for name in SKILLS[: draw(st.integers(1, most_skills))])
    made_events = ()
    if events and draw(st.booleans()):
        made_events = (Event("e", condition(draw, lambda d: atom(d, resources)), _effect(draw, resources, possible=draw(st.booleans()))),)
    skillset = Skillset(
        "random", resources=resources, skills=skills, events=made_events, data=(Data("d", "float64", 1.0),) if timed else ()
    )
    return skillset if not properties else draw(_with_properties(skillset))


@st.composite
def sparse_skillsets(draw):
    """Four or five resources and skills that each use three of them: one is taken, the others are asked for; some slip."""
    names = [f"r{i}" for i in range(draw(st.integers(4, 5)))]
    both_ways = (Transition("A", "B"), Transition("B", "A"))
    resources = tuple(
        Resource(n, ("A", "B"), "A", (*both_ways, *draw(st.sampled_from([(), (Transition("B", "A", True),)])))) for n in names
    )
    skills = []
    for number in range(draw(st.integers(2, 4))):
        mine, *others = draw(st.permutations(names))[:3]
        give = Effect("", (Assignment(mine, "A"),))
        asked = [ResourceIs(name, draw(st.sampled_from("AAAB"))) for name in (mine, *others)]
        invariants = [Invariant("keeps", And(tuple(asked[1:])), give), Invariant("holds", ResourceIs(mine, "B"))]
        kept = draw(st.sampled_from([invariants, invariants, invariants[1:], invariants[:1]]))
        skills.append(
            Skill(
                f"f{number}",
                preconditions=tuple(Precondition(f"p{i}", one) for i, one in enumerate(asked[draw(st.sampled_from([0, 0, 0, 1])) :])),
                start=Effect("", (Assignment(mine, "B"),)),
                invariants=tuple(kept),
                interrupt=Interrupt(effect=draw(st.sampled_from([give, give, NO_EFFECT]))),
                results=(Result("OK", ResultKind.SUCCESS, give),),
            )
        )
    wanted = (
        Property("w0", PropertyKind.NEVER, And((SkillRuns("f0"), SkillRuns("f1")))),
        Property("w1", PropertyKind.LEADS_TO, SkillRuns("f0"), ResourceIs(names[0], "A"), draw(st.booleans())),
    )
    return Skillset("sparse", resources=resources, skills=tuple(skills), properties=wanted)


@st.composite
def _with_properties(draw, skillset):
    def leaf(_draw):
        if draw(st.booleans()):
            return SkillRuns(draw(st.sampled_from(skillset.skills)).name)
        return atom(draw, skillset.resources)

    wanted = []
    for number, kind in enumerate(draw(st.lists(st.sampled_from(PropertyKind), min_size=1, max_size=3))):
        consequence = condition(draw, leaf, 1) if kind is PropertyKind.LEADS_TO else None
        wanted.append(Property(f"w{number}", kind, condition(draw, leaf, 1), consequence, draw(st.booleans())))
    return replace(skillset, properties=tuple(wanted))
