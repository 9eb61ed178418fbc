"""Random models, with all that the notations can say; they need not make sense."""

from __future__ import annotations

import string

from hypothesis import strategies as st

from alula.language.paper import skill as paper
from alula.language.rl import skill as rl
from alula.language.syntax.cursor import OPERATOR_WORDS
from alula.language.syntax.document import MEMBERS
from alula.language.syntax.resources import every_transition, occurring, with_silence
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
    Parameter,
    Precondition,
    Progress,
    Property,
    PropertyKind,
    Resource,
    Result,
    ResultKind,
    Role,
    Skill,
    Skillset,
    Transition,
)

WORDS = OPERATOR_WORDS | set(paper.BLOCKS) | set(rl.BLOCKS) | set(MEMBERS) | {"skillset", "all", "period"}
TRAPS = ["initial", "violation", "apply", "post", "extern", "state", "guard", "postcondition", "interrupting", "running", "never"]
TRAPS += ["leads", "to", "assuming", "for", "recovers", "at", "deadline", "silence", "message", "m", "s", "transition", "always"]

names = st.one_of(
    st.sampled_from(["a", "b", "axes_authority", "OK", *TRAPS]),
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
values_with_names = st.lists(st.builds(lambda n, t, c: Parameter(n, t, comment=c), names, names, comments), max_size=3).map(tuple)
defaults = st.sampled_from(["", "0.5", "-1e3 m/s", "20 %", '"a b"', "true", "AUTO"])
parameters = st.lists(st.builds(Parameter, names, names, defaults, comments), max_size=2).map(tuple)
changes = st.lists(st.builds(Assignment, names, names), max_size=3).map(tuple)
in_place = changes.map(lambda found: Effect("", found))
holds = st.one_of(
    st.builds(Hold, floats),
    st.builds(Hold, floats, floats, st.sampled_from(["", "%", "m/s"]) | names),
)
effects = st.builds(Effect, names, changes)
events = st.builds(Event, names, postconditions | any_condition, in_place)
progresses = st.builds(Progress, floats, names | st.just(""), st.none() | floats, values_with_names)


@st.composite
def properties(draw):
    condition = conditions(resource_atoms | st.builds(SkillRuns, names))
    kind = draw(st.sampled_from(PropertyKind))
    consequence = draw(condition) if kind is PropertyKind.LEADS_TO else None
    return Property(draw(names), kind, draw(condition), consequence, draw(st.booleans()))


@st.composite
def resources(draw):
    name, initial = draw(names), draw(names | st.just(""))
    transitions = tuple(draw(st.lists(st.builds(Transition, names, names, st.booleans()), max_size=4)))
    states = occurring(initial, transitions)
    if draw(st.booleans()):
        states = tuple(draw(st.permutations([*states, *draw(st.lists(names, max_size=2))])))
    every = draw(st.booleans())
    if every:
        transitions = (*transitions, *(a for a in every_transition(states) if a not in transitions))
    silence_s = draw(st.none() | floats)
    if silence_s is not None:
        transitions = with_silence(transitions, states, initial)
    return Resource(name, states, initial, transitions, all_transitions=every, silence_s=silence_s)


roles = st.lists(st.builds(Role, names), max_size=2).map(tuple)


def results(used):
    return st.builds(Result, names, st.sampled_from(ResultKind), used, postconditions, comments)


@st.composite
def skills(draw):
    defined = draw(st.lists(effects, max_size=3, unique_by=lambda effect: effect.name))
    used = st.sampled_from([NO_EFFECT, *defined]) | in_place
    return Skill(
        name=draw(names),
        parameters=draw(parameters),
        inputs=draw(values_with_names),
        outputs=draw(values_with_names),
        effects=tuple(defined),
        preconditions=tuple(draw(st.lists(st.builds(Precondition, names, any_condition), max_size=3))),
        start=draw(used),
        invariants=tuple(draw(st.lists(st.builds(Invariant, names, any_condition, used, st.none() | holds), max_size=3))),
        progress=draw(st.none() | progresses),
        interrupt=draw(st.builds(Interrupt, st.booleans(), used, postconditions, st.none() | floats)),
        results=tuple(draw(st.lists(results(used), max_size=3))),
        provides=draw(roles),
        needs=draw(roles),
        achieves=draw(st.just(TRUE) | any_condition),
    )


skillsets = st.builds(
    Skillset,
    names,
    types=st.lists(names, max_size=2, unique=True).map(tuple),
    parameters=parameters,
    data=st.lists(st.builds(Data, names, names, st.none() | floats), max_size=2).map(tuple),
    resources=st.lists(resources(), max_size=3).map(tuple),
    events=st.lists(events, max_size=2).map(tuple),
    skills=st.lists(skills(), max_size=3).map(tuple),
    properties=st.lists(properties(), max_size=2).map(tuple),
    uses=st.lists(names, max_size=2).map(tuple),
)
