"""Every log of a folder predicted from the others: held-out errors pooled over all of them."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from auvident.stages.segment import segment_both
from tests.engines.chain import chain_of, plan_named

KVLCC2 = Path(__file__).resolve().parents[2] / "sample_logs" / "kvlcc2"
COLUMNS = {"u": "u_mps", "v": "v_mps", "r": "r_radps"}


def left_out(
    logs: Path = KVLCC2, plans=("spiral", "refined", "coloured", "likely"), kind: str = "ekf"
) -> list[dict[str, Any]]:
    """Pooled error over standard deviation of u, v and r, by plan.

    Parameters
    ----------
    logs : Path
        Folder of Parquet files, one trial each, and ``vehicle.toml``.
    plans : sequence of str
    kind : str
        ``ekf`` or ``ukf``.
    """
    base = chain_of(sorted(logs.glob("*.parquet")), logs / "vehicle.toml")
    found = []
    for plan in plans:
        pieces = [_predicted(base, trial.name, plan, kind) for trial in base.trials]
        errors, measured = (np.concatenate(part) for part in zip(*pieces, strict=True))
        ratio = np.sqrt(np.nanmean(errors**2, axis=0)) / np.nanstd(measured, axis=0)
        found.append({"plan": plan, "filter": kind, **dict(zip(COLUMNS, ratio, strict=True))})
    return found


def _predicted(base, name: str, plan: str, kind: str) -> tuple[np.ndarray, np.ndarray]:
    """Errors and readings (n, 3) of a trial that had no part in the identification."""
    chain = replace(base, maneuvers=segment_both(base.trials, (name,)))
    held = [m.id for m in chain.maneuvers.maneuvers if m.role == "validate"]
    model = chain.identify(filter=kind, plan=plan_named(plan)).model
    table = chain.validate(model).simulation
    table = table[table["maneuver"].isin(held)]
    measured, simulated = (
        table[[f"{c}_{which}" for c in COLUMNS.values()]].to_numpy()
        for which in ("measured", "simulated")
    )
    return simulated - measured, measured
