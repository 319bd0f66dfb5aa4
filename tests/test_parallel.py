"""Work side by side: in order, the same bytes, and linear algebra on one thread."""

import os
import subprocess
import sys
import threading
import time
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
        crew = parallel._Crew(number - 1)
        monkeypatch.setattr(parallel, "threads", lambda: number)
        monkeypatch.setattr(parallel, "_crew", lambda: crew)

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


@pytest.mark.parametrize("waits", ["who asked", "another"])
def test_who_has_nothing_left_takes_part_in_what_the_last_piece_needs(waits, with_threads) -> None:
    with_threads(2)
    first, inside = (threading.Barrier(2, timeout=10.0) for _ in range(2))
    asks = threading.get_ident()

    def outer(_: int) -> list[int]:
        first.wait()  # one has a piece, the other has the other
        if (threading.get_ident() == asks) == (waits == "who asked"):
            return []
        return parallel.each(lambda _: inside.wait(), range(2))  # breaks where nobody helps

    assert sorted(parallel.each(outer, range(2)), key=len)[0] == []
    assert not inside.broken


def test_pieces_within_pieces_within_pieces_come_to_an_end(with_threads) -> None:
    with_threads(3)

    def summed(depth: int) -> int:
        return 1 + sum(parallel.each(summed, [depth - 1] * 3)) if depth else 1

    assert summed(6) == sum(3**k for k in range(7))


def test_an_error_inside_reaches_who_asked_outside(with_threads) -> None:
    with_threads(2)

    def outer(k: int) -> list[float]:
        return parallel.each(lambda j: 1.0 / (k - j), range(3))

    assert parallel.each(outer, [5, 4]) == [[1 / 5, 1 / 4, 1 / 3], [1 / 4, 1 / 3, 1 / 2]]
    with pytest.raises(ZeroDivisionError):
        parallel.each(outer, [5, 4, 1])


def test_an_interrupt_begins_nothing_more(with_threads) -> None:
    with_threads(2)
    asks, begun = threading.get_ident(), []
    interrupted = threading.Event()

    def piece(k: int) -> None:
        begun.append(k)
        if threading.get_ident() == asks:
            interrupted.set()
            raise KeyboardInterrupt
        interrupted.wait(10.0)
        time.sleep(0.1)  # until it has reached who asked

    with pytest.raises(KeyboardInterrupt):
        parallel.each(piece, range(50))
    time.sleep(0.2)
    assert len(begun) <= 3
    both = threading.Barrier(2, timeout=10.0)  # and the others are there for what comes
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


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no copies of processes")
def test_a_copy_of_the_process_has_threads_of_its_own() -> None:
    script = (
        "import os, threading; from auvident.parallel import each\n"
        "def both():\n"
        "    barrier = threading.Barrier(2, timeout=10.0)\n"
        "    return sorted(each(lambda _: barrier.wait(), range(2)))\n"
        "both(); copy = os.fork()\n"
        "if copy == 0: os._exit(both() != [0, 1])\n"
        "print(os.waitpid(copy, 0)[1])"
    )
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", script],
        check=True, capture_output=True, text=True, env={**os.environ, parallel.VARIABLE: "2"},
    )  # fmt: skip
    assert done.stdout.strip() == "0"


@pytest.mark.parametrize(("number", "loaded"), [("1", "False"), ("2", "True")])
def test_a_module_is_loaded_beside_where_there_is_a_second_thread(number: str, loaded: str) -> None:
    script = (
        "import sys, time; from auvident import parallel\n"
        "parallel.load_beside('no.such.module'); parallel.load_beside('colorsys')\n"
        "ends = time.monotonic() + 10.0 * (parallel.threads() > 1)\n"
        "while 'colorsys' not in sys.modules and time.monotonic() < ends: time.sleep(0.01)\n"
        "print('colorsys' in sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", script],
        check=True, capture_output=True, text=True, env={**os.environ, parallel.VARIABLE: number},
    )  # fmt: skip
    assert done.stdout.strip() == loaded
