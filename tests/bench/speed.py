"""Time of one filter pass against filterpy's, and of a whole identification."""

import json
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Callable
from pathlib import Path
from statistics import median
from time import perf_counter, process_time
from typing import Any

import numpy as np

from auvident.engines import compiled, reference
from auvident.engines.estimator import free_positions
from auvident.engines.problem import FilterProblem
from auvident.engines.records import Record, stack
from auvident.engines.setup import active_states
from auvident.pipeline.steps import DEFAULT_PLAN
from auvident.schema.plan import PlanStage
from auvident.schema.planes import PLANES
from auvident.stages.identify import shared_of
from auvident.storage.plan_file import PLANS
from tests.engines.chain import SAMPLES, Chain, chain_of, plan_named, sample

LATERAL = ("inertia", "lift", "cross_flow", "control")
PASSES = {  # of one maneuver: system, free coefficients
    "15 states (yaw-sway)": ("lateral", LATERAL),
    "16 states (coupled, lateral coefficients)": ("coupled", LATERAL),
    "22 states (coupled, with thrust and drag in turns)": (
        "coupled",
        (*LATERAL, "thrust", "turning_drag"),
    ),
    "24 states (coupled, every coefficient)": ("coupled", ("all",)),
}
OBSERVER_S = 30.0
LONG_S = 1800.0
TRUTH = Path(__file__).resolve().parents[1] / "truth"


def seconds(work: Callable[[], Any], repeats: int) -> float:
    """Median time of a piece of work, after one run that compiles and warms up."""
    work()
    times = []
    for _ in range(repeats):
        start = perf_counter()
        work()
        times.append(perf_counter() - start)
    return median(times)


def side_by_side(fast: Callable[[], Any], slow: Callable[[], Any], repeats: int):
    """Times of two pieces of work in turn, so that a busy machine slows both."""
    pairs = [(seconds(fast, 5), seconds(slow, 1)) for _ in range(repeats)]
    return [a for a, _ in pairs], [b for _, b in pairs]


def one_pass(chain: Chain, system: str, free: tuple[str, ...], rows: int) -> FilterProblem:
    """A filter problem on one zigzag of a trial."""
    setup = chain.setup()
    longest = max(
        (r for kind, r in setup.records.values() if kind == "zigzag"), key=lambda r: len(r.time_s)
    )
    parts = (getattr(longest, n)[:rows] for n in ("time_s", "inputs", "given", "measured"))
    records, starts = stack([Record(longest.id, *parts, longest.start)], setup.dt_s)
    positions = free_positions(setup, PlanStage(name="pass", system=system, free=free))
    active, noise, n = active_states(system, "horizontal"), setup.sensor_std, len(positions)
    return FilterProblem(
        structure=setup.structure,
        records=records,
        parameters=setup.prior,
        free=positions,
        followers=setup.followers[np.isin(setup.followers[:, 1], positions)],
        scale=setup.prior_std[positions],
        theta_covariance=np.eye(n),
        theta_noise=np.zeros(n),
        active=active,
        channels=active.copy(),
        sensor=setup.sensor,
        process_std=noise * np.sqrt(setup.dt_s) / OBSERVER_S,
        sensor_std=noise,
        start=starts,
        start_std=3.0 * noise,
    )


def passes(repeats: int = 5, rows: int = 600) -> list[dict[str, Any]]:
    """Compiled and filterpy passes side by side, in one process."""
    chain = sample("harbour_trial")
    found = []
    for name, (system, free) in PASSES.items():
        problem = one_pass(chain, system, free, rows)
        for kind in ("ekf", "ukf"):
            fast, slow = side_by_side(
                lambda p=problem, k=kind: compiled.run(p, k),
                lambda p=problem, k=kind: reference.run(p, k),
                repeats,
            )
            found.append(
                {
                    "pass": name,
                    "filter": kind,
                    "steps": len(problem.records.inputs[0]),
                    "states": len(problem.free) + int(problem.active.sum()),
                    "compiled_ms": 1e3 * median(fast),
                    "filterpy_ms": 1e3 * median(slow),
                    "ratio": median(b / a for a, b in zip(fast, slow, strict=True)),
                }
            )
    return found


def long_trial(share: float = 1.0) -> Chain:
    """A trial of 30 minutes with 12 maneuvers, from the independent generator of the samples."""
    recipe = tomllib.loads((TRUTH / "harbour_trial.toml").read_text())
    count = {"straights": 2, "turns": 4, "zigzags_10": 3, "zigzags_20": 3}
    recipe |= {"name": "long", "schedule": {k: round(v * share) or 1 for k, v in count.items()}}
    return generated(recipe)


def generated(recipe: dict[str, Any]) -> Chain:
    """A trial of the generator of the samples, up to its identification."""
    sys.path.insert(0, str(SAMPLES))
    from seatrial.trial import generate

    folder = Path(tempfile.mkdtemp(prefix="auvident-bench-")) / recipe["name"]
    generate(recipe, folder)
    return chain_of([folder], SAMPLES / "remus100.toml")


def whole(repeats: int = 3, shares=(0.5, 1.0), plan: str = "refined") -> list[dict[str, Any]]:
    """Whole identifications of the long trial and of one half as long."""
    found = []
    for share in shares:
        chain = long_trial(share)
        used = [
            m for m in chain.maneuvers.maneuvers if m.role == "identify" and m.shows("horizontal")
        ]
        for kind in ("ekf", "ukf"):
            took = processor_seconds(
                lambda c=chain, k=kind: c.identify(filter=k, plan=plan_named(plan)), repeats
            )
            found.append(
                {
                    "plan": plan,
                    "filter": kind,
                    "maneuvers": len(used),
                    "trial_min": len(chain.trials[0].table) / chain.trials[0].rate_hz / 60.0,
                    "data_s": sum(m.t_end_s - m.t_start_s for m in used),
                    "processor_s": took,
                }
            )
    return found


BOTH = {  # some 40 minutes with maneuvers of both planes
    "name": "both",
    "vehicle": "remus100",
    "seed": 5,
    "plane": "both",
    "schedule": {"turns": 5, "zigzags_10": 3, "zigzags_20": 3, "vertical_zigzags": 6},
}


def both_planes(repeats: int = 3) -> list[dict[str, Any]]:
    """Processor time of what `identify` computes of a long trial with maneuvers of both planes."""
    chain = generated(BOTH)
    found = []
    for kind in ("ekf", "ukf"):
        took = processor_seconds(lambda k=kind: _identify_both(chain, k), repeats)
        minutes = len(chain.trials[0].table) / chain.trials[0].rate_hz / 60.0
        counts = {
            f"{plane} maneuvers": sum(
                m.role == "identify" and m.shows(plane) for m in chain.maneuvers.maneuvers
            )
            for plane in PLANES
        }
        found.append({"filter": kind, "trial_min": minutes, **counts, "processor_s": took})
    return found


def _identify_both(chain: Chain, kind: str) -> None:
    """The horizontal plane, then the vertical one with what they share, as a run does."""
    plan = plan_named(DEFAULT_PLAN)
    first = chain.identify("horizontal", kind, plan=plan).model
    chain.identify("vertical", kind, plan=plan, shared=shared_of(first))


def processor_seconds(work: Callable[[], Any], repeats: int) -> float:
    """Median processor time of a piece of work, its threads included, once it is compiled."""
    work()
    times = []
    for _ in range(repeats):
        start = process_time()
        work()
        times.append(process_time() - start)
    return median(times)


MEMORY = """
import json, resource, sys
sys.path.insert(0, {root!r})
from tests.engines.chain import sample
sample("harbour_trial").identify(filter={kind!r})
print(json.dumps(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024))
"""


def memory() -> list[dict[str, Any]]:
    """Peak memory [MB] of a process that reads, ingests and identifies a sample trial."""
    root = str(Path(__file__).resolve().parents[2])
    found = []
    for kind in ("ekf", "ukf"):
        code = MEMORY.format(root=root, kind=kind)
        out = subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, check=True
        )
        found.append({"filter": kind, "peak_mb": json.loads(out.stdout)})
    return found


def plans(trial: str = "harbour_trial", repeats: int = 1) -> list[dict[str, Any]]:
    """Held-out errors and time of every built-in plan with both filters."""
    chain, found = sample(trial), []
    for path in sorted(PLANS.glob("*.toml")):
        for kind in ("ekf", "ukf"):
            plan = plan_named(path.stem)
            model = chain.identify(filter=kind, plan=plan).model
            took = seconds(lambda p=plan, k=kind: chain.identify(filter=k, plan=p), repeats)
            held_out = chain.validate(model).metrics.summary["validate"]
            errors = {f"nrmse_{c}": held_out[c].nrmse for c in ("u", "v", "r") if c in held_out}
            found.append({"plan": path.stem, "filter": kind, **errors, "seconds": took})
    return found
