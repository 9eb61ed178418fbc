"""The one error of records, and of the models and expectations that they are checked against."""

from __future__ import annotations

from alula.common.errors import AlulaError


class AnalysisError(AlulaError):
    """A file can't be read, or a request does not fit it; the message names the place and the remedy."""
