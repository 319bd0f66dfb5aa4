"""`auvident ase` on vehicle files: one estimate, several side by side, or a sweep."""

from collections.abc import Sequence
from pathlib import Path

from auvident.cli.common import Output, refuse_no_table, write_table
from auvident.cli.precious import refuse_precious

SHOWN_VARIANTS = 20  # rows of a sweep on the console


def compare_designs(output: Output, files: Sequence[Path]) -> None:
    """Estimate of each vehicle file; JSON is one result, or a list of them."""
    from auvident.report.ase_tables import ase_report, side_by_side
    from auvident.stages.ase import estimate
    from auvident.storage.vehicle_file import load_vehicle

    results = [estimate(load_vehicle(file)) for file in files]
    with output.watch() as watch:
        watch.show(ase_report(results[0]) if len(results) == 1 else side_by_side(results))
    output.artifact(results[0] if len(results) == 1 else results, "ase/coefficients.json")


def show_sweep(output: Output, file: Path, texts: Sequence[str], target: Path | None) -> None:
    """Coefficients of every variant: to a file, as JSON, or the first on the console."""
    from auvident.physics.ase.sweep import parse_sweep, sweep
    from auvident.report.console import frame_table
    from auvident.storage.vehicle_file import load_vehicle

    refuse_no_table(target)
    refuse_precious(target, file)
    grid = parse_sweep(texts)
    table = sweep(load_vehicle(file), grid)
    if target is not None:
        write_table(table, target)
    possible = table[table["problem"] == ""]
    columns = [*grid, "Y_uv", "N_uv", "Y_uud", "N_uud", "G_H", "G_V", "turning_gain_per_m"]
    shown = possible[[c for c in columns if c in possible]].head(SHOWN_VARIANTS)
    with output.watch() as watch:
        watch.show(frame_table(f"{len(possible)} of {len(table)} variants are feasible", shown))
        watch.note(f"All columns: {target}" if target else "All columns: --output FILE.parquet")
    if output.json:
        records = table.astype(object).where(table.notna(), None).to_dict("records")
        output.artifact({"schema": "auvident/sweep/1", "variants": records}, "sweep")
