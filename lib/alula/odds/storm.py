"""Asks the model checker Storm: the least and the greatest chance of an outcome, the time to the end, and slopes."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from alula.odds.errors import OddsError
from alula.odds.process import Chances, Choice, Process
from alula.odds.system import Outcome

EXACT_STATES = 500
"""Up to so many states numbers are fractions without an error: the effort grows faster than the states, by the digits."""
PRECISION = "1/1000000000"
"""Relative, of numbers that are no fractions; their bounds are proved (optimistic value iteration)."""
MISSING = "needs the Python package stormpy (the model checker Storm): pip install 'alula[odds]' brings it"
GOAL = "goal"
ONE = Fraction(1)


@dataclass(frozen=True)
class Number:
    """A number with its bounds: the true value is from ``low`` to ``high``, which are the same where it is exact."""

    low: Fraction
    high: Fraction

    @property
    def exact(self) -> bool:
        """Return whether the bounds are the same."""
        return self.low == self.high

    @property
    def value(self) -> float:
        """The middle of the bounds."""
        return float((self.low + self.high) / 2)

    def complement(self) -> Number:
        """Return the bounds of the complementary probability."""
        return Number(1 - self.high, 1 - self.low)


@dataclass(frozen=True)
class Extreme:
    """The least or the greatest chance; what each state's is; and in each state the choice that brings it about."""

    number: Number
    values: Sequence[Fraction]
    choices: Sequence[int]


class Storm:
    """A decision process, loaded into the model checker Storm.

    Args:
        process: with the state 0 as its first.
        exact: with fractions; None: as the number of states allows.

    Raises:
        OddsError: Storm is not installed.
    """

    def __init__(self, process: Process, *, exact: bool | None = None) -> None:
        try:
            import stormpy  # late: no other command needs it
        except ModuleNotFoundError:
            raise OddsError(MISSING) from None
        self._stormpy = stormpy
        self._process = process
        self.exact = len(process.choices) <= EXACT_STATES if exact is None else exact
        self._type: Any = stormpy.Rational if self.exact else float
        self._environment = self._settings()
        rows = [[(choice.to, choice.mean_s) for choice in choices] for choices in process.choices]
        self._matrix = self._built(rows)
        self._times = [self._value(mean_s) for choices in rows for _, mean_s in (choices or [({}, Fraction(0))])]

    def chance(self, outcomes: Collection[Outcome], *, most: bool) -> Extreme:
        """Return the least or the greatest chance that it ends in one of these ways.

        What was not looked at counts as the worse for the least, as the better for the greatest.
        """
        goals = [number for number, outcome in enumerate(self._process.outcomes) if outcome in outcomes]
        goals += self._process.open if most else ()
        result = self._checked(f'P{"max" if most else "min"}=? [F "{GOAL}"]', self._mdp(goals), schedule=True)
        values = [self._fraction(result.get_value(state)) for state in range(len(self._process.choices))]
        plan = [result.get_scheduler().get_choice(state).get_deterministic_choice() for state in range(len(values))]
        return Extreme(self._bounded(result), values, plan)

    def seconds(self, *, most: bool) -> Number | None:
        """Return the least or the greatest mean time to an end, in seconds; None: it has no bound, for it may never end."""
        ends = [number for number, outcome in enumerate(self._process.outcomes) if outcome is not None]
        goals = [*ends, *(() if most else self._process.open)]
        result = self._checked(f'R{"max" if most else "min"}=? [F "{GOAL}"]', self._mdp(goals))
        return None if str(result.get_value(0)) in {"inf", "Infinity"} else self._bounded(result)

    def slopes(self, extreme: Extreme) -> dict[str, float]:
        """Return how much an extreme chance changes with each figure, by its name, per its unit (1/s, 1).

        In the chain that the extreme's choices leave, the derivative is the sum over the states of the expected visits, times what
        the chances of the next states change by, times the chances from there.
        """
        process = self._process
        chain = [[(choices[plan].to, choices[plan].mean_s)] if choices else [] for choices, plan in _planned(process, extreme)]
        result = self._stormpy.analysis.compute_expected_number_of_visits(self._dtmc(chain), environment=self._environment)
        found: dict[str, Fraction] = {}
        for state, (choices, plan) in enumerate(_planned(process, extreme)):
            slopes = choices[plan].slopes if choices else {}
            for name, slope in slopes.items():
                change = sum((by * extreme.values[to] for to, by in slope.items()), Fraction(0))
                if change:  # where it goes round for ever the visits have no bound, but nothing changes there either
                    found[name] = found.get(name, Fraction(0)) + self._fraction(result.get_value(state)) * change
                found.setdefault(name, Fraction(0))
        return {name: float(slope) for name, slope in found.items()}

    # --- Storm --------------------------------------------------------------------------------------------------------

    def _settings(self) -> Any:
        environments = self._stormpy.environments
        if self.exact:
            return environments.exact()
        settings = environments.sound()
        # One of the methods that give bounds with the value: the default for small parts gives none.
        settings.solver().min_max().method = environments.MinMaxMethod.OPTIMISTIC_VALUE_ITERATION
        settings.solver().min_max().precision = self._stormpy.Rational(PRECISION)
        return settings

    def _value(self, value: Fraction) -> Any:
        return self._stormpy.Rational(f"{value.numerator}/{value.denominator}") if self.exact else float(value)

    def _fraction(self, value: Any) -> Fraction:
        return Fraction(str(value)) if self.exact else Fraction(float(value))

    def _bounded(self, result: Any) -> Number:
        """Return the first state's value."""
        bounded = result[0]
        value = self._fraction(bounded.value)
        if self.exact or bounded.lower is None or bounded.upper is None:
            return Number(value, value)
        return Number(Fraction(float(bounded.lower)), Fraction(float(bounded.upper)))

    def _checked(self, formula: str, model: Any, *, schedule: bool = False) -> Any:
        stormpy = self._stormpy
        return stormpy.model_checking(
            model, stormpy.parse_properties(formula)[0], extract_scheduler=schedule, environment=self._environment
        )

    def _built(self, rows: Sequence[Sequence[tuple[Chances, Fraction]]], *, grouped: bool = True) -> Any:
        """Return the matrix: a group of rows a state; one that has ended stays there."""
        make = self._stormpy.datastructures.SparseMatrixBuilder[self._type]
        filled = [
            [{to: chance for to, chance in chances.items() if chance} for chances, _ in one] or [{at: ONE}] for at, one in enumerate(rows)
        ]
        size = sum(map(len, filled)), sum(len(row) for one in filled for row in one)
        builder = make(
            rows=size[0], columns=len(rows), entries=size[1], force_dimensions=True, has_custom_row_grouping=grouped, row_groups=0
        )  # forced: a last state that nothing leads to would be no column
        row = 0
        for one in filled:
            if grouped:
                builder.new_row_group(row)
            for to in one:
                for column in sorted(to):
                    builder.add_next_value(row, column, self._value(to[column]))
                row += 1
        return builder.build()

    def _labels(self, goals: Collection[int]) -> Any:
        labels = self._stormpy.models.StateLabeling(len(self._process.choices))
        for label, states in (("init", [0]), (GOAL, goals)):
            labels.add_label(label)
            for state in states:
                labels.add_label_to_state(label, state)
        return labels

    def _mdp(self, goals: Collection[int]) -> Any:
        models = self._stormpy.models
        times = models.SparseRewardModel[self._type](optional_state_action_reward_vector=self._times)
        parts = models.SparseModelComponents[self._type](self._matrix, self._labels(goals), {"seconds": times})
        return models.SparseMdp[self._type](parts)

    def _dtmc(self, rows: Sequence[Sequence[tuple[Chances, Fraction]]]) -> Any:
        models = self._stormpy.models
        parts = models.SparseModelComponents[self._type](self._built(rows, grouped=False), self._labels(()))
        return models.SparseDtmc[self._type](parts)


def _planned(process: Process, extreme: Extreme) -> list[tuple[Sequence[Choice], int]]:
    return list(zip(process.choices, extreme.choices, strict=True))
