"""The end of a run: makes its report from the recordings, prints the verdict, and gives the exit code."""

from __future__ import annotations

import sys
from pathlib import Path

from alula.common.deployments import DeploymentError, load_deployment
from alula.common.robots import find_robot
from alula.records.conformance import Monitor
from alula.report.aborts import close_account
from alula.report.deaths import read_deaths
from alula.runtime.live.spec import RunSpec

GIVEN_UP, CANNOT_START = 1, 2
"""Exit codes of a run that did not reach its goal, and of one that could not begin, as the mission's own; 0: accomplished."""


def finish(spec: RunSpec, mission_exit: int | None, monitor: Monitor | None = None) -> int:
    """Make the report from the run's folder, of which nothing runs any more, say how it went, and return the exit code."""
    # Late, because a wrong command line should not have to wait for matplotlib and Open3D.
    from alula.report.facts import RunFacts
    from alula.report.making import make_report
    from alula.report.verdict import verdict_lines

    out = Path(spec.out_dir)
    died = read_deaths(out)
    close_account(out, mission_exit)
    summary = make_report(
        RunFacts(
            scenario=spec.scenario,
            seed=spec.seed,
            out_dir=out,
            faults=list(spec.faults),
            died=[{"name": d.name, "when_s": d.when_s, "how": d.how, "again_s": d.again_s} for d in died],
            mission_exit=mission_exit,
            conformance=None if monitor is None else monitor.verdict.as_dict(),
            recorded=is_recorded(spec),
        )
    )
    for line in verdict_lines(summary, died, out):
        sys.stdout.write(line + "\n")
    return mission_exit if mission_exit is not None else GIVEN_UP


def is_recorded(spec: RunSpec) -> bool:
    """Return whether the functional layer is recorded in a run; on a deployment it need not be."""
    if not spec.deployment:
        return True
    try:
        return bool(load_deployment(spec.deployment, find_robot()).topics)
    except DeploymentError:  # written anew since the run began
        return True
