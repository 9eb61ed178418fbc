"""Small random models that make sense to the checker: every name leads somewhere."""

from __future__ import annotations

from hypothesis import strategies as st

from skill_language.model import (
    NO_EFFECT,
    TRUE,
    And,
    Assignment,
    Constant,
    Effect,
    Event,
    Implies,
    Interrupt,
    Invariant,
    Not,
    Or,
    Precondition,
    Property,
    PropertyKind,
    Resource,
    ResourceIs,
    Result,
    ResultKind,
    Skill,
    SkillRuns,
    Skillset,
    Transition,
)

RESOURCES = ("r", "q", "p")
SKILLS = ("f", "g", "h")


def _resources(draw, most):
    made = []
    for name in RESOURCES[: draw(st.integers(1, most))]:
        states = ("A", "B", "C")[: draw(st.integers(2, 3))]
        arrow = st.builds(Transition, st.sampled_from(states), st.sampled_from(states), st.booleans())
        arrows = draw(st.lists(arrow, min_size=2, max_size=6, unique_by=lambda t: (t.source, t.target, t.extern)))
        made.append(Resource(name, states, states[0], tuple(arrows)))
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


def _effect(draw, resources):
    names = draw(st.lists(st.sampled_from([r.name for r in resources]), max_size=2, unique=True))
    by_name = {resource.name: resource for resource in resources}
    return Effect("", tuple(Assignment(name, draw(st.sampled_from(by_name[name].states))) for name in names)) if names else NO_EFFECT


def _skill(draw, name, resources):
    def asks():
        return condition(draw, lambda d: atom(d, resources))

    def post():
        return asks() if draw(st.booleans()) else TRUE

    kinds = st.sampled_from(ResultKind)
    return Skill(
        name=name,
        preconditions=tuple(Precondition(f"p{i}", asks()) for i in range(draw(st.integers(0, 2)))),
        start=_effect(draw, resources),
        invariants=tuple(Invariant(f"i{i}", asks(), _effect(draw, resources)) for i in range(draw(st.integers(0, 2)))),
        interrupt=Interrupt(effect=_effect(draw, resources), postcondition=post()),
        results=tuple(Result(f"R{i}", draw(kinds), _effect(draw, resources), post()) for i in range(draw(st.integers(1, 2)))),
    )


@st.composite
def skillsets(draw, *, most_resources=3, most_skills=3, properties=False, events=True):
    resources = _resources(draw, most_resources)
    skills = tuple(_skill(draw, name, resources) for name in SKILLS[: draw(st.integers(1, most_skills))])
    made_events = ()
    if events and draw(st.booleans()):
        made_events = (Event("e", condition(draw, lambda d: atom(d, resources)), _effect(draw, resources)),)
    skillset = Skillset("random", resources=resources, skills=skills, events=made_events)
    return skillset if not properties else draw(_with_properties(skillset))


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
    return Skillset(skillset.name, resources=skillset.resources, skills=skillset.skills, events=skillset.events, properties=tuple(wanted))
