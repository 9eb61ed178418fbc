"""What was read of a skill, and how it becomes one: the effects that it refers to are put in."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from alula.common.suggestions import nearest
from alula.language.lexer import Source, Token
from alula.model.expressions import TRUE, Expression
from alula.model.model import NO_EFFECT, Effect, Interrupt, Invariant, Parameter, Precondition, Progress, Result, Role, Skill


@dataclass
class SkillParts:
    """What was read of a skill so far; an effect that is referred to has only its name until ``build``."""

    parameters: list[Parameter] = field(default_factory=list)
    inputs: list[Parameter] = field(default_factory=list)
    outputs: list[Parameter] = field(default_factory=list)
    effects: list[Effect] = field(default_factory=list)
    preconditions: list[Precondition] = field(default_factory=list)
    start: Effect = NO_EFFECT
    invariants: list[Invariant] = field(default_factory=list)
    progress: Progress | None = None
    interrupt: Interrupt = field(default_factory=Interrupt)
    results: list[Result] = field(default_factory=list)
    provides: list[Role] = field(default_factory=list)
    needs: list[Role] = field(default_factory=list)
    achieves: Expression = TRUE
    effects_complete: bool = True
    """False after an error in the `effect` block: an effect that is missed may have been in the part that was not read."""

    def build(self, name: Token, source: Source) -> Skill:
        """Return the skill; report effects that it refers to and doesn't have."""
        # Of two effects of one name the first counts; ``check`` tells of the other.
        named = {effect.name: effect for effect in reversed(self.effects)}

        def resolve(reference: Effect) -> Effect:
            if not reference.name:
                return reference
            if reference.name in named:
                return replace(named[reference.name], span=reference.span)
            if not self.effects_complete:
                return reference
            hint = nearest(reference.name, named) or "define it in an `effect` block of the skill"
            source.report("ALU204", f"skill `{name.text}` has no effect `{reference.name}`", reference.span, hint=hint)
            return reference

        return Skill(
            name=name.text,
            parameters=tuple(self.parameters),
            inputs=tuple(self.inputs),
            outputs=tuple(self.outputs),
            effects=tuple(self.effects),
            preconditions=tuple(self.preconditions),
            start=resolve(self.start),
            invariants=tuple(replace(i, effect=resolve(i.effect)) for i in self.invariants),
            progress=self.progress,
            interrupt=replace(self.interrupt, effect=resolve(self.interrupt.effect)),
            results=tuple(replace(r, effect=resolve(r.effect)) for r in self.results),
            provides=tuple(self.provides),
            needs=tuple(self.needs),
            achieves=self.achieves,
            span=source.span(name),
        )
