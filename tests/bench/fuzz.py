"""Damaged files against the readers: only errors of the family may escape, and none may hang.

``python -m tests.bench.fuzz --budget 1800`` damages what users write and what the program keeps
(logs of every format, map, vehicle, plan, run.json, model.json) again and again, each time in
another way, and reads it. What escapes is kept with the file that did it, in the folder that
``--output`` names. A child process does the reading, so that a crash of a
library is a finding as well.
"""

import argparse
import multiprocessing
import random
import resource
import shutil
import signal
import tempfile
import time
import tomllib
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from tests.bench.fuzz_containers import NAMES, containers, overwritten
from tests.command_line import SAMPLES

PIECES = (
    *(b"", b",", b";", b"\n", b"\r", b'"', b"'", b"#", b"[", b"]", b"{", b"}", b"=", b".", b"-"),
    *(b"nan", b"NaN", b"inf", b"1e999", b"1e308", b"-1", b"0", b"9" * 5000, b"true", b"null"),
    *(b"\0", b"\xff\xfe", b"\xef\xbb\xbf", b"\x1b[31m", b"\\ud800", b"\xed\xa0\x80", b"\t", b" "),
    *(b"../", b"/dev/zero", b"C:\\", b"'''", b'"""', b"[[fin]]", b"[hull]", b"time_s", b"1,5"),
    *(b"2020-01-01T00:00:00Z", b"99999999999999999999", b"\x80", b"[/dev]", b"%s", b"0x1p3"),
)
MOST_REPEATED_BYTES = 200_000
MEMORY_BYTES = 8 << 30
SLOW_S = 60  # a case that takes longer is a finding
BATCH_S = 120.0  # of one child


@dataclass(frozen=True)
class Target:
    """Something that is read: the name of its file, sound contents, and the reader."""

    name: str
    file: str
    sound: tuple[bytes, ...]
    read: Callable[[Path], object]


def damaged(content: bytes, others: Sequence[bytes], rng: random.Random) -> bytes:
    """One to six things gone wrong."""
    for _ in range(rng.randint(1, 6)):
        content = rng.choice(DAMAGES)(content, others, rng)
    return content


def _cut(content: bytes, others: Sequence[bytes], rng: random.Random) -> bytes:
    at = rng.randint(0, len(content))
    return content[:at] + content[at + int(10 ** rng.uniform(0, 4)) :]


def _insert(content: bytes, others: Sequence[bytes], rng: random.Random) -> bytes:
    at, piece = rng.randint(0, len(content)), rng.choice(PIECES)
    return content[:at] + piece + content[at + rng.choice((0, 0, len(piece))) :]


def _repeat(content: bytes, others: Sequence[bytes], rng: random.Random) -> bytes:
    at, piece = rng.randint(0, len(content)), rng.choice(PIECES)
    times = min(int(10 ** rng.uniform(0.3, 4.3)), MOST_REPEATED_BYTES // max(len(piece), 1))
    return content[:at] + piece * times + content[at:]


def _flip(content: bytes, others: Sequence[bytes], rng: random.Random) -> bytes:
    changed = bytearray(content)
    for _ in range(rng.randint(1, 8) if changed else 0):
        changed[rng.randrange(len(changed))] = rng.randrange(256)
    return bytes(changed)


def _number(content: bytes, others: Sequence[bytes], rng: random.Random) -> bytes:
    """Another number in the place of one."""
    places = [k for k, c in enumerate(content[:20_000]) if 48 <= c <= 57]
    if not places:
        return content
    at = end = rng.choice(places)
    while end < len(content) and content[end : end + 1] in b"0123456789.eE+-":
        end += 1
    new = rng.choice((b"0", b"-1", b"1e300", b"-1e-300", b"nan", b"inf", b"1e6", b'""', b"[]"))
    return content[:at] + new + content[end:]


def _splice(content: bytes, others: Sequence[bytes], rng: random.Random) -> bytes:
    other = rng.choice(others)
    return content[: rng.randint(0, len(content))] + other[rng.randint(0, len(other)) :]


DAMAGES = (_cut, _insert, _insert, _repeat, _flip, overwritten, _number, _number, _splice)


def targets(work: Path, only: Sequence[str]) -> list[Target]:
    """What is read: of these names, or all of it."""
    found = [Target(*parts) for parts in containers(work, only)]
    if not only or set(only) - set(NAMES):
        found += [t for t in _texts(work) if not only or t.name in only]
    return found


def _texts(work: Path) -> list[Target]:
    """Text, Parquet and artifacts, with a run in a folder that some of it stands in."""
    import pandas as pd

    from auvident.pipeline import run_all
    from auvident.pipeline.predict import find_model
    from auvident.pipeline.run import status
    from auvident.stages.ase import estimate
    from auvident.stages.export import FORMS, export
    from auvident.stages.ingest import ingest
    from auvident.storage.artifacts import json_bytes
    from auvident.storage.log_inspect import inspect_log
    from auvident.storage.logs import read_column_map, read_trials
    from auvident.storage.plan_file import PLANS, read_plan
    from auvident.storage.run_directory import RunDirectory
    from auvident.storage.vehicle_file import load_vehicle
    from tests.engines.chain import identified

    log, vehicle_file = SAMPLES / "harbour_trial", SAMPLES / "remus100.toml"
    vehicle = load_vehicle(vehicle_file)
    options = {"ingest": {"logs": [log], "vehicle": vehicle_file}}
    run_all(work / "run", options, until="ase")
    wide = pd.read_parquet(next((work / "run" / "ingest").glob("*.parquet"))).head(400)
    wide["rudder_deg"] = wide.pop("rudder_rad") * 57.3
    text = wide.dropna(axis=1, how="all").to_csv(index=False).encode()
    wide.to_parquet(work / "wide.parquet")
    short = shutil.copytree(log, work / "short")
    for file in short.glob("*.csv"):
        file.write_bytes(b"\n".join(file.read_bytes().split(b"\n")[:300]) + b"\n")

    def one_sensor(path: Path) -> None:
        shutil.copy(path, short / "dvl.csv")
        (trial,) = read_trials([short])
        ingest(trial, vehicle)

    def whole_log(path: Path) -> None:
        read_trials([path])

    def mapped(path: Path) -> None:
        read_trials([log], read_column_map(path))

    def geometry(path: Path) -> None:
        estimate(load_vehicle(path))

    def manifest(path: Path) -> None:
        shutil.copy(path, work / "run" / "run.json")
        RunDirectory(work / "run").manifest()
        status(work / "run")

    def exported(path: Path) -> None:
        _, model = find_model(path)
        for form in FORMS:
            text = export(model, form)
            text.encode()
            if form == "python":
                compile(text, form, "exec")
            elif form == "toml":
                tomllib.loads(text)

    dvl = (short / "dvl.csv").read_bytes()
    column_map = (
        b'[dvl]\nfile = "dvl.csv"\ntime = "time_s"\nu = { column = "u_mps", unit = "mps" }\n'
    )
    column_map += b'[rudder]\nrudder = { column = "rudder_deg", unit = "deg", sign = -1 }\n'
    plans = tuple(p.read_bytes() for p in sorted(PLANS.glob("*.toml")))
    vehicles = tuple(p.read_bytes() for p in sorted(SAMPLES.glob("*.toml")))
    model = json_bytes(identified("harbour_trial").model, "model.json")
    run_json = (work / "run" / "run.json").read_bytes()
    return [
        Target("wide log", "wide.csv", (text,), whole_log),
        Target("sensor file", "dvl.csv", (dvl,), one_sensor),
        Target("inspect", "wide.csv", (text, dvl), inspect_log),
        Target("parquet", "wide.parquet", ((work / "wide.parquet").read_bytes(),), whole_log),
        Target("map", "map.toml", (column_map,), mapped),
        Target("vehicle", "vehicle.toml", vehicles, geometry),
        Target("plan", "plan.toml", plans, read_plan),
        Target("manifest", "run.json", (run_json,), manifest),
        Target("model", "model.json", (model,), exported),
    ]


def fault(target: Target, path: Path) -> str:
    """What escapes that should not; "" for nothing."""
    from auvident.errors import AuvidentError

    signal.alarm(SLOW_S)
    try:
        target.read(path)
    except AuvidentError as error:
        return "" if error.problem else "an error without a problem"
    except OSError as error:  # named, the command line tells it
        return "" if error.filename else traceback.format_exc()
    except BaseException:
        return traceback.format_exc()
    finally:
        signal.alarm(0)
    return ""


class SlowError(BaseException):
    """A case took too long; readers take every other error of a library for damage."""


def _slow(number: int, frame: object) -> None:
    raise SlowError(f"took more than {SLOW_S} s")


def batch(only: Sequence[str], seed: int, output: Path, case: Path) -> None:
    """Cases until the time of a child is over; what escapes is written to `output`.

    All is made in the child: threads of a library do not survive a fork.
    """
    import warnings

    warnings.simplefilter("ignore")
    found = targets(case, only)
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    signal.signal(signal.SIGALRM, _slow)
    (case / "case").mkdir()
    rng, end, count = random.Random(seed), time.monotonic() + BATCH_S, 0
    while time.monotonic() < end:
        target = rng.choice(found)
        path = case / "case" / target.file
        path.write_bytes(damaged(rng.choice(target.sound), target.sound, rng))
        (case / "now").write_text(target.file)
        escaped, count = fault(target, path), count + 1
        if escaped:
            keep(output, target, path, escaped)
    (case / "now").unlink()
    (case / "count").write_text(str(count))


def keep(output: Path, target: Target, path: Path, escaped: str) -> None:
    """The file and what it did; of one kind once."""
    last = [line for line in escaped.splitlines() if line.startswith("  File")][-1:]
    name = f"{target.name}-{abs(hash((target.name, *last))) % 10**8:08d}".replace(" ", "-")
    if not (output / f"{name}.txt").exists():
        shutil.copy(path, output / f"{name}{path.suffix}")
        (output / f"{name}.txt").write_text(escaped, errors="backslashreplace")
        print(f"{name}: {escaped.strip().splitlines()[-1][:200]}", flush=True)


def main() -> None:
    """Fuzz until the time is over; exit code 1 if anything has escaped."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--budget", type=float, default=1800.0, help="seconds")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--output", type=Path, default=Path("fuzz-findings"))
    parser.add_argument("--only", nargs="*", help="names of targets")
    asked = parser.parse_args()
    asked.output.mkdir(parents=True, exist_ok=True)
    end, seed, total = time.monotonic() + asked.budget, asked.seed, 0
    fork = multiprocessing.get_context("fork")
    while time.monotonic() < end:
        with tempfile.TemporaryDirectory() as folder:
            case, seed = Path(folder), seed + 1
            child = fork.Process(target=batch, args=(asked.only or (), seed, asked.output, case))
            child.start()
            child.join(BATCH_S + 3 * SLOW_S)
            if child.exitcode != 0 and not (case / "now").exists():
                child.kill()
                raise SystemExit("a child did not get as far as to read: nothing is fuzzed")
            elif child.exitcode != 0:
                child.kill()
                file = (case / "now").read_text()
                shutil.copy(case / "case" / file, asked.output / f"crash-{seed}-{file}")
                print(f"crash-{seed}-{file}: exit code {child.exitcode}", flush=True)
            else:
                total += int((case / "count").read_text())
    kept = sorted(asked.output.iterdir())
    print(f"{total} damaged files read; {len(kept)} files of findings in {asked.output}")
    raise SystemExit(bool(kept))


if __name__ == "__main__":
    main()
