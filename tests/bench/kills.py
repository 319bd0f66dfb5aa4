"""`auvident run` killed at random moments: does the next run complete, with the same result?

``python -m tests.bench.kills --kills 200`` kills a run with SIGKILL at moments spread over its
whole duration, lets the next one finish, and holds every file of the run directory, byte for byte,
against that of an undisturbed run. Only times differ: those of the manifest, and of the report,
which shows them.
"""

import argparse
import json
import random
import re
import shutil
import signal
import subprocess
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from tests.command_line import ENVIRONMENT, PROGRAM, SAMPLES

# In the report: when a stage ended, and how long it took; in the last line, when the run was.
WHEN = re.compile(
    rb'\d{4}-\d\d-\d\d \d\d:\d\d:\d\d</td>\s*<td class="n">[^<]*</td>'
    rb"|run of \d{4}-\d\d-\d\d \d\d:\d\d UTC"
)
# Keys of the manifest; the hash of the report, which shows times, is one of them.
TIMES = ("started_at", "ended_at", "created_at", "at", "report/report.html")
WAITED_S = 900.0  # for a run that is not killed


@dataclass(frozen=True)
class Killed:
    """One kill: when, whether the run was still going, what was different after the next."""

    after_s: float
    hit: bool
    differing: tuple[str, ...]


def command(log: Path, vehicle: Path, run: Path, *more: str) -> list[str]:
    """The run that is killed."""
    logs = [str(log), "--vehicle", str(vehicle), "--run", str(run), "--quiet"]
    return [str(PROGRAM), "run", *logs, *more]


def finished(words: list[str]) -> float:
    """Run to the end; its duration [s]."""
    start = time.monotonic()
    done = subprocess.run(words, env=ENVIRONMENT, capture_output=True, timeout=WAITED_S)
    if done.returncode:
        raise RuntimeError(f"exit code {done.returncode}: {done.stderr.decode()}")
    return time.monotonic() - start


def killed(words: list[str], after_s: float) -> bool:
    """Start, and kill after some time; whether it was still going."""
    process = subprocess.Popen(
        words, env=ENVIRONMENT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    try:
        process.wait(after_s)
    except subprocess.TimeoutExpired:
        process.send_signal(signal.SIGKILL)
        process.wait()
        return True
    return False


def contents(run: Path) -> dict[str, bytes]:
    """Every file of a run directory, without the times."""
    files = {str(p.relative_to(run)): p for p in sorted(run.rglob("*")) if p.is_file()}
    return {name: _timeless(name, path.read_bytes()) for name, path in files.items()}


def _timeless(name: str, content: bytes) -> bytes:
    if name == "run.json":
        return json.dumps(_without_times(json.loads(content)), indent=1).encode()
    return WHEN.sub(b"WHEN", content) if name.endswith(".html") else content


def _without_times(tree: object) -> object:
    if isinstance(tree, dict):
        return {k: _without_times(v) for k, v in tree.items() if k not in TIMES}
    return tree


def differing(run: Path, undisturbed: dict[str, bytes]) -> tuple[str, ...]:
    """Files that are not as in the undisturbed run, or stand in one of the two only."""
    found = contents(run)
    names = sorted(found.keys() | undisturbed.keys())
    return tuple(n for n in names if found.get(n) != undisturbed.get(n))


def kill_many(
    folder: Path, kills: int, seed: int, budget_s: float, log: Path, vehicle: Path, *more: str
) -> list[Killed]:
    """Kill runs in one and the same directory, each at another moment; it starts anew each time.

    The directory has one name throughout, as the manifest keeps paths relative to it.
    """
    run, rng, end = folder / "run", random.Random(seed), time.monotonic() + budget_s
    words = command(log, vehicle, run, *more)
    finished(words)  # compiles, fills caches
    shutil.rmtree(run)
    lasts_s = finished(words)
    undisturbed, found = contents(run), []
    while len(found) < kills and time.monotonic() < end:
        shutil.rmtree(run, ignore_errors=True)
        after_s = rng.uniform(0.0, lasts_s)
        hit = killed(words, after_s)
        finished(words)
        found.append(Killed(after_s, hit, differing(run, undisturbed)))
    return found


def main() -> None:
    """Print a line for what differed, and the count."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--budget", type=float, default=3600.0, help="seconds")
    parser.add_argument("--log", type=Path, default=SAMPLES / "harbour_trial")
    parser.add_argument("--vehicle", type=Path, default=SAMPLES / "remus100.toml")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        found = kill_many(place, asked.kills, asked.seed, asked.budget, asked.log, asked.vehicle)
    for one in (k for k in found if k.differing):
        print(f"killed after {one.after_s:.2f} s: {', '.join(one.differing)} differ")
    hits, same = sum(k.hit for k in found), sum(not k.differing for k in found)
    print(f"{len(found)} runs, {hits} killed at work, {same} as undisturbed after the next run")


if __name__ == "__main__":
    main()
