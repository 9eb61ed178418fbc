"""What a run should be: outcome, order, times, states, and what must never happen; as a file, checked, and written from a run."""

from run_analysis.expectations.checking import Checked, check
from run_analysis.expectations.junit import junit
from run_analysis.expectations.reading import load_expectations
from run_analysis.expectations.values import Expectations
from run_analysis.expectations.writing import expectations_of

__all__ = ["Checked", "Expectations", "check", "expectations_of", "junit", "load_expectations"]
