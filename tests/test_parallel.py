"""Work side by side: in order, the same bytes, and linear algebra on one thread."""

import os
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from auvident import parallel
from auvident.pipeline.execution import make
from auvident.pipeline.given import Given
from auvident.pipeline.table import BY_NAME
from auvident.stages.diagnose.fit.fits import fit_with
from auvident.stages.diagnose.score.first_order import joint_about
from auvident.storage.run_directory import RunDirectory
from tests.stages.diagnose.loop_chain import small_case, small_fit


@pytest.fixture
def with_threads(monkeypatch: pytest.MonkeyPatch):
    """Sets the number of threads."""

    def set_to(number: int) -> None:
        pool = ThreadPoolExecutor(number)
        monkeypatch.setattr(parallel, "threads", lambda: number)
        monkeypatch.setattr(parallel, "_pool", lambda: pool)

    return set_to


@pytest.mark.parametrize("number", [1, 3])
def test_results_come_in_the_order_of_the_items(number, with_threads) -> None:
    with_threads(number)

    def late(k: int) -> int:
        time.sleep(0.01 * (3 - k))
        return k

    assert parallel.each(late, range(4)) == [0, 1, 2, 3]
    assert parallel.each(late, []) == []


def test_the_longest_begin_first_and_the_order_stays(with_threads) -> None:
    with_threads(2)
    begun = []

    def note(k: int) -> int:
        begun.append(k)
        time.sleep(0.01)
        return -k

    assert parallel.each(note, [3, 1, 4, 2], lambda k: k) == [-3, -1, -4, -2]
    assert set(begun[:2]) == {4, 3} and set(begun[2:]) == {2, 1}


def test_several_work_at_the_same_time(with_threads) -> None:
    with_threads(2)
    both = threading.Barrier(2, timeout=10.0)  # breaks where one waits for the other
    assert sorted(parallel.each(lambda _: both.wait(), range(2))) == [0, 1]


@pytest.mark.parametrize("number", [1, 2])
def test_an_error_of_one_is_an_error(number, with_threads) -> None:
    with_threads(number)
    with pytest.raises(ZeroDivisionError):
        parallel.each(lambda k: 1 / k, (1, 0))


@pytest.mark.parametrize(("asked", "expected"), [("1", 1), ("3", 3), ("0", None), ("two", None)])
def test_the_environment_says_how_many(asked, expected, monkeypatch) -> None:
    monkeypatch.setenv(parallel.VARIABLE, asked)
    parallel.threads.cache_clear()
    try:
        found = parallel.threads()
    finally:
        parallel.threads.cache_clear()
    assert found == expected if expected else 1 <= found <= parallel.MOST_THREADS


def test_fits_and_scores_are_the_same_bytes_with_one_thread_or_several(with_threads) -> None:
    case, start = small_case(), small_fit()
    found = []
    for number in (1, 2, 4):
        with_threads(number)
        fitted = fit_with(case, ("rudder_lag",), start.parameters, start.colours, rounds=1, steps=2)
        joint = joint_about(case, start, ("current", "gyro_bias"))
        assert fitted is not None and joint is not None
        found.append((fitted.parameters, joint.gradient, joint.curvature, joint.raw))
    for other in found[1:]:
        for a, b in zip(found[0], other, strict=True):
            np.testing.assert_array_equal(a, b)


def test_a_stage_runs_with_one_thread_for_linear_algebra(tmp_path: Path) -> None:
    seen = []

    class Stopped(Exception):
        pass

    def look(given) -> None:
        seen.extend(i["num_threads"] for i in threadpool_info() if i["user_api"] == "blas")
        raise Stopped

    with threadpool_limits(2, user_api="blas"), pytest.raises(Stopped):
        make(replace(BY_NAME["ase"], function=look), Given(RunDirectory(tmp_path)))
    assert seen and set(seen) == {1}


def test_what_is_asked_for_inside_is_done_by_the_same_thread(with_threads) -> None:
    with_threads(2)

    def outer(k: int) -> set[int]:
        return {threading.get_ident(), *parallel.each(lambda _: threading.get_ident(), range(3))}

    assert [len(found) for found in parallel.each(outer, range(4))] == [1, 1, 1, 1]
    both = threading.Barrier(2, timeout=10.0)  # and side by side again behind it
    assert sorted(parallel.each(lambda _: both.wait(), range(2))) == [0, 1]


def test_linear_algebra_that_is_limited_already_is_not_loaded_to_limit_it() -> None:
    script = (
        "import sys; from auvident.parallel import one_blas_thread\n"
        "with one_blas_thread(): print('scipy.linalg' in sys.modules)"
    )
    for number, loaded in (("1", "False"), ("2", "True")):
        limited = dict.fromkeys(parallel.BLAS_VARIABLES, number)
        done = subprocess.run(
            [sys.executable, "-c", script],
            check=True, capture_output=True, text=True, env={**os.environ, **limited},
        )  # fmt: skip
        assert done.stdout.strip() == loaded


@pytest.mark.parametrize(("number", "loaded"), [("1", "False"), ("2", "True")])
def test_a_module_is_loaded_beside_where_there_is_a_second_thread(number: str, loaded: str) -> None:
    script = (
        "import sys; from auvident import parallel\n"
        "parallel.load_beside('no.such.module'); parallel.load_beside('colorsys')\n"
        "parallel._pool().shutdown(); print('colorsys' in sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", script],
        check=True, capture_output=True, text=True, env={**os.environ, parallel.VARIABLE: number},
    )  # fmt: skip
    assert done.stdout.strip() == loaded
