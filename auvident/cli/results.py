"""Commands that look at run directories."""

from pathlib import Path

from auvident.cli.common import RUN, Output, command


@command("status", "auvident status runs/demo")
@RUN
def status(output: Output, run: Path) -> None:
    """Say which stages are done, stale or missing, and why."""
    from auvident.pipeline import status as judge
    from auvident.report.console import status_table

    decisions, manifest = judge(run)
    rows = []
    for decision in decisions:
        entry, attempt = manifest.stages.get(decision.stage), manifest.failed.get(decision.stage)
        rows.append(
            {
                "stage": decision.stage,
                "state": decision.state,
                "reason": decision.reason,
                "ended_at": entry.ended_at if entry else None,
                "outputs": sorted(entry.outputs) if entry else [],
                "failed": attempt,
            }
        )
    with output.watch() as watch:
        watch.show(status_table(run, rows))
    output.artifact({"schema": "auvident/status/1", "run": str(run), "stages": rows}, "status")
