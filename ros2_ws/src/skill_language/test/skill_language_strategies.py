"""Random models that the paper's notation can say; they need not make sense."""

from __future__ import annotations

import string

from hypothesis import strategies as st

from skill_language.model import (
    NO_EFFECT,
    TRUE,
    And,
    Assignment,
    Comparison,
    Constant,
    Data,
    DataIs,
    Effect,
    Implies,
    Interrupt,
    Invariant,
    Not,
    Or,
    Parameter,
    Precondition,
    Progress,
    Resource,
    ResourceIs,
    Result,
    Skill,
    Skillset,
    Transition,
)
from skill_language.paper.cursor import OPERATOR_WORDS
from skill_language.paper.skill import BLOCKS, MEMBERS
from skill_language.paper.skillset import every_arrow, occurring

WORDS = OPERATOR_WORDS | set(BLOCKS) | set(MEMBERS) | {"skillset", "all", "period"}

names = st.one_of(
    st.sampled_from(["a", "b", "axes_authority", "OK", "initial", "violation", "success", "apply", "post", "extern", "state"]),
    st.text(string.ascii_letters + string.digits + "_", min_size=1, max_size=6).filter(lambda n: not n[0].isdigit()),
).filter(lambda name: name not in WORDS)
floats = st.floats(allow_nan=False, allow_infinity=False)
comments = st.text(string.ascii_letters + string.digits + " </>\"'\\{}é", max_size=12).map(lambda text: " ".join(text.split()))

resource_atoms = st.builds(ResourceIs, names, names, st.booleans())
values = st.one_of(floats, st.text(st.characters(codec="utf-8", exclude_characters="\r"), max_size=5), st.booleans())
data_atoms = st.builds(
    lambda data, path, comparison, value, unit: DataIs(data, tuple(path), comparison, value, unit if type(value) is float else ""),
    names,
    st.lists(names, max_size=2),
    st.sampled_from(Comparison),
    values,
    st.one_of(st.sampled_from(["", "%", "m/s"]), names),
)


def conditions(leaves):
    def grow(inner):
        several = st.lists(inner, min_size=2, max_size=3).map(tuple)
        return st.one_of(st.builds(Not, inner), st.builds(And, several), st.builds(Or, several), st.builds(Implies, inner, inner))

    return st.recursive(leaves | st.builds(Constant, st.booleans()), grow, max_leaves=6)


any_condition = st.one_of(conditions(resource_atoms), conditions(data_atoms), conditions(resource_atoms | data_atoms))
postconditions = st.just(TRUE) | conditions(resource_atoms)
parameters = st.lists(st.builds(lambda n, t, c: Parameter(n, t, comment=c), names, names, comments), max_size=3).map(tuple)
effects = st.builds(lambda n, a: Effect(n, tuple(a)), names, st.lists(st.builds(Assignment, names, names), max_size=3))


@st.composite
def resources(draw):
    name, initial = draw(names), draw(names | st.just(""))
    arrows = tuple(draw(st.lists(st.builds(Transition, names, names, st.booleans()), max_size=4)))
    states = occurring(initial, arrows)
    if draw(st.booleans()):
        states = tuple(draw(st.permutations([*states, *draw(st.lists(names, max_size=2))])))
    if draw(st.booleans()):
        return Resource(name, states, initial, arrows, all_transitions=False)
    return Resource(name, states, initial, (*arrows, *(a for a in every_arrow(states) if a not in arrows)), all_transitions=True)


def results(used):
    return st.builds(lambda n, e, p, c: Result(n, effect=e, postcondition=p, comment=c), names, used, postconditions, comments)


@st.composite
def skills(draw):
    defined = draw(st.lists(effects, max_size=3, unique_by=lambda effect: effect.name))
    used = st.sampled_from([NO_EFFECT, *defined])
    return Skill(
        name=draw(names),
        inputs=draw(parameters),
        outputs=draw(parameters),
        effects=tuple(defined),
        preconditions=tuple(draw(st.lists(st.builds(Precondition, names, any_condition), max_size=3))),
        start=draw(used),
        invariants=tuple(draw(st.lists(st.builds(Invariant, names, any_condition, used), max_size=3))),
        progress=draw(st.none() | st.builds(Progress, floats)),
        interrupt=draw(st.builds(lambda e, p: Interrupt(effect=e, postcondition=p), used, postconditions)),
        results=tuple(draw(st.lists(results(used), max_size=3))),
    )


skillsets = st.builds(
    lambda name, types, data, states, able: Skillset(name, tuple(types), (), tuple(data), tuple(states), (), tuple(able)),
    names,
    st.lists(names, max_size=2),
    st.lists(st.builds(Data, names, names, st.none() | floats), max_size=2),
    st.lists(resources(), max_size=3),
    st.lists(skills(), max_size=3),
)
