"""What a run should be: outcome, order, times, states, and what must never happen; as a file, checked, and written from a run."""

from alula.records.expectations.checking import Checked, check
from alula.records.expectations.junit import junit
from alula.records.expectations.reading import load_expectations
from alula.records.expectations.values import Expectations
from alula.records.expectations.writing import expectations_of

__all__ = ["Checked", "Expectations", "check", "expectations_of", "junit", "load_expectations"]
