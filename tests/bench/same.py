"""Whether two run directories hold the same results: `python -m tests.bench.same BEFORE AFTER`.

Text must be equal, numbers to a relative difference; what only says how and when a run was made
(``run.json``, the report's files) is not looked at.
"""

import argparse
import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

RELATIVE = 1.0e-9
NOT_RESULTS = ("run.json", "report/", ".lock")


def differences(before: Path, after: Path) -> Iterator[str]:
    """Yield one line for each value that is not the same, and for each missing file."""
    names = {p.relative_to(d).as_posix() for d in (before, after) for p in d.rglob("*.*")}
    for name in sorted(n for n in names if not n.startswith(NOT_RESULTS)):
        if not (before / name).is_file() or not (after / name).is_file():
            yield f"{name}: only in {'after' if (after / name).exists() else 'before'}"
        elif (before / name).read_bytes() != (after / name).read_bytes():
            yield from (f"{name}: {line}" for line in _of_file(before / name, after / name))


def _of_file(before: Path, after: Path) -> Iterator[str]:
    if before.suffix == ".json":
        return _values("", json.loads(before.read_text()), json.loads(after.read_text()))
    if before.suffix == ".parquet":
        return _tables(pd.read_parquet(before), pd.read_parquet(after))
    return iter(["other bytes"])


def _values(where: str, a: Any, b: Any) -> Iterator[str]:
    """Differences of two values of JSON, with the place of each."""
    if isinstance(a, dict) and isinstance(b, dict):
        for key in {**a, **b}:
            missing = (key not in a) - (key not in b)
            if missing:
                yield f"{where}/{key}: only in {'after' if missing > 0 else 'before'}"
            else:
                yield from _values(f"{where}/{key}", a[key], b[key])
    elif isinstance(a, list) and isinstance(b, list) and len(a) == len(b):
        for i, (x, y) in enumerate(zip(a, b, strict=True)):
            yield from _values(f"{where}[{i}]", x, y)
    elif not _same(a, b):
        yield f"{where}: {a!r} -> {b!r}"


def _same(a: Any, b: Any) -> bool:
    if isinstance(a, int | float) and isinstance(b, int | float) and not isinstance(a, bool):
        return math.isclose(a, b, rel_tol=RELATIVE, abs_tol=0.0)
    return bool(a == b)


def _tables(a: pd.DataFrame, b: pd.DataFrame) -> Iterator[str]:
    """Differences of two tables; numbers against the largest of their column."""
    if list(a.columns) != list(b.columns) or len(a) != len(b):
        yield f"columns or rows: {list(a.columns)}, {len(a)} -> {list(b.columns)}, {len(b)}"
        return
    for name in a.columns:
        x, y = a[name].to_numpy(), b[name].to_numpy()
        if x.dtype.kind == "f":
            size = np.nanmax(np.abs(x), initial=0.0)
            if not np.allclose(x, y, rtol=RELATIVE, atol=RELATIVE * size, equal_nan=True):
                off = np.nanmax(np.abs(x - y)) / max(size, 1e-300)
                yield f"{name}: by {off:.2g} of its largest"
        elif not np.array_equal(x, y):
            yield f"{name}: other values"


def main() -> None:
    """Say what differs, or that nothing does; exit with 1 where something does."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("before", type=Path)
    parser.add_argument("after", type=Path)
    parser.add_argument("--most", type=int, default=30, help="lines of each run")
    given = parser.parse_args()
    runs = sorted(p.parent.relative_to(given.before) for p in given.before.rglob("run.json"))
    if not runs:
        raise SystemExit(f"{given.before}: no run directory")
    total = 0
    for run in runs:
        found = list(differences(given.before / run, given.after / run))
        total += len(found)
        print(f"{run}: {len(found) or 'no'} differences", *found[: given.most], sep="\n    ")
    raise SystemExit(1 if total else 0)


if __name__ == "__main__":
    main()
