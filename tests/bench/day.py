"""A day and more of a gyro at 100 Hz: reading, `ingest` and `segment` by the length of the log.

The log is a generated trial, tiled: motion and commands repeat, the noise of each sensor is drawn
anew. Every figure is from a process of its own, as the peak of memory is that of a process; seconds
are those of the processor, without the start of the program.
"""

import json
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
from pyarrow import csv, parquet

from tests.bench.length import KINDS, SEED, VEHICLE
from tests.engines.chain import SAMPLES

HOURS = (0.55, 5.5, 24.0, 44.5)  # 0.2, 2, 8.6 and 16 million readings of the gyro
RATES_HZ = {"gyro": 100.0, "dvl": 5.0, "rudder": 10.0, "rpm": 5.0}
HELD = ("rudder", "rpm")  # commands, which stand until the next one
NOISE = {"degps": 0.1, "mps": 0.005}
DECIMALS = {"degps": 3, "mps": 4, "deg": 3, "rpm": 1}
MILLION, MIB = 1e6, 1024.0**2
PYARROW = """
from pyarrow import csv
one = csv.ReadOptions(use_threads=False)
def work(log, run, vehicle):
    for file in sorted(log.iterdir()):
        for column in csv.read_csv(file, one).columns:
            column.to_numpy()
"""
READ = """
from auvident.storage.logs import read_trials
import auvident.storage.log_csv, pandas
def work(log, run, vehicle):
    read_trials([log])
"""
STAGE = """
import pandas, pyarrow.csv, pyarrow.parquet, scipy.linalg
import auvident.stages.ingest, auvident.stages.segment, auvident.storage.log_csv
from auvident.pipeline import run_stage
from auvident.pipeline.observer import Observer
def work(log, run, vehicle):
    first = {{"logs": (log,), "vehicle": vehicle}} if "{0}" == "ingest" else None
    run_stage("{0}", run, first, observer=Observer())
"""
# The peak of `getrusage` is at least that of the process that started this one.
MEASURED = """
import json, sys, time
from pathlib import Path
arguments = [Path(a) for a in sys.argv[1:]]
start = time.process_time()
work(*arguments)
spent = time.process_time() - start
status = dict(line.split(":", 1) for line in open("/proc/self/status"))
print(json.dumps({"s": spent, "peak_mib": int(status["VmHWM"].split()[0]) / 1024}))
"""

Rows = list[dict[str, Any]]


def day(repeats: int = 3, hours: Sequence[float] = HOURS) -> dict[str, Rows]:
    """Medians by length of the log, growth between lengths, and reading held against pyarrow."""
    with tempfile.TemporaryDirectory(prefix="auvident-day-") as name:
        base = generated(Path(name))
        logs = [tiled(base, 3600.0 * h, Path(name) / f"log-{k}") for k, h in enumerate(hours)]
        longest = as_parquet(logs[-1], Path(name) / "log-parquet")
        whole = measured(STAGE.format("ingest"), longest, repeats)
        peak = {"ingest_s": whole["s"], "ingest_peak_MiB": round(whole["peak_mib"])}
        by_length = [_stages(log, repeats) for log in logs]
        return {
            "by length of the log": _with_growth(by_length),
            "the longest one by format": [
                {
                    "format": "CSV",
                    **_reading(logs[-1], repeats),
                    **{k: by_length[-1][k] for k in peak},
                },
                {"format": "Parquet", **_reading(longest, repeats), **peak},
            ],
        }


def generated(folder: Path) -> dict[str, pd.DataFrame]:
    """The sensors of one trial of twelve maneuvers."""
    if str(SAMPLES) not in sys.path:
        sys.path.insert(0, str(SAMPLES))
    from seatrial.trial import generate

    recipe = {"name": "base", "vehicle": VEHICLE, "seed": SEED, "schedule": KINDS}
    generate(recipe, folder / "base")
    return {sensor: pd.read_csv(folder / "base" / f"{sensor}.csv") for sensor in RATES_HZ}


def tiled(base: Mapping[str, pd.DataFrame], seconds: float, folder: Path) -> Path:
    """A log of so many seconds as CSV, a file for each sensor."""
    folder.mkdir()
    rng = np.random.default_rng(SEED)
    plain = csv.WriteOptions(quoting_style="none")
    for sensor, table in base.items():
        at = np.arange(int(seconds * RATES_HZ[sensor])) / RATES_HZ[sensor]
        columns = {"time_s": np.round(at, 3)}
        for column in (c for c in table.columns[1:] if c != "valid"):
            columns[column] = _repeated(table["time_s"], table[column], at, sensor, rng)
        csv.write_csv(pa.table(columns), folder / f"{sensor}.csv", plain)
    return folder


def _repeated(
    time: pd.Series, values: pd.Series, at: np.ndarray, sensor: str, rng: np.random.Generator
) -> np.ndarray:
    """One column at other times, from the beginning again where the trial ends."""
    unit = str(values.name).rsplit("_", 1)[-1]
    known = np.isfinite(values)
    t, x = (column[known].to_numpy(dtype=float) for column in (time, values))
    phase = t[0] + np.mod(at, t[-1] - t[0])
    if sensor in HELD:
        found = x[np.searchsorted(t, phase, side="right") - 1]
    else:
        found = np.interp(phase, t, x) + NOISE[unit] * rng.standard_normal(at.size)
    return np.round(found, DECIMALS[unit])


def as_parquet(log: Path, folder: Path) -> Path:
    """The same log in another format."""
    folder.mkdir()
    for file in log.iterdir():
        parquet.write_table(csv.read_csv(file), folder / f"{file.stem}.parquet")
    return folder


def _stages(log: Path, repeats: int) -> dict[str, Any]:
    """Seconds and peak of memory of both stages on one log."""
    rows = sum(1 for _ in (log / "gyro.csv").open("rb")) - 1
    spent = {stage: measured(STAGE.format(stage), log, repeats) for stage in ("ingest", "segment")}
    return {
        "gyro_million_rows": rows / MILLION,
        "CSV_MiB": round(sum(f.stat().st_size for f in log.iterdir()) / MIB),
        **{f"{stage}_s": found["s"] for stage, found in spent.items()},
        **{f"{stage}_peak_MiB": round(found["peak_mib"]) for stage, found in spent.items()},
    }


def _with_growth(rows: Rows) -> Rows:
    """The rows with the exponent of the growth of each stage since the row before."""
    for stage in ("ingest", "segment"):
        key, before = f"{stage}_s", None
        for row in rows:
            row[f"{stage}_exponent"] = (
                "" if before is None else round(_exponent(before, row, key), 2)
            )
            before = row
    return rows


def _exponent(one: Mapping[str, Any], other: Mapping[str, Any], key: str) -> float:
    by = other["gyro_million_rows"] / one["gyro_million_rows"]
    return float(np.log(other[key] / one[key]) / np.log(by))


def _reading(log: Path, repeats: int) -> dict[str, Any]:
    """Reading one log alone, held against pyarrow where it is text."""
    own = measured(READ, log, repeats)["s"]
    text = next(iter(log.iterdir())).suffix == ".csv"
    over = own / measured(PYARROW, log, repeats)["s"] if text else ""
    return {"read_s": own, "over_pyarrow": over}


def measured(work: str, log: Path, repeats: int) -> dict[str, float]:
    """Medians of some processes that do one piece of work on a log."""
    run, vehicle = log.with_name(f"{log.name}-run"), SAMPLES / f"{VEHICLE}.toml"
    arguments = [sys.executable, "-c", work + MEASURED, str(log), str(run), str(vehicle)]
    found = []
    for _ in range(repeats):
        done = subprocess.run(arguments, check=True, capture_output=True, text=True)
        found.append(json.loads(done.stdout.splitlines()[-1]))
    return {key: median(one[key] for one in found) for key in found[0]}
