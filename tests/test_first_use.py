"""Helpers that compile: what they run, when they are called, and that they may fail."""

import pickle
import subprocess
import sys
from dataclasses import replace

import pytest

from auvident import first_use
from auvident.first_use import compile_side_by_side
from auvident.stages.identify import warm_up
from auvident.stages.identify.warm_up import compile_first, pieces_of
from tests.engines.test_estimator import linear_setup

PIECES = 2


@pytest.fixture
def cold(monkeypatch: pytest.MonkeyPatch) -> list[subprocess.Popen]:
    """Nothing is compiled; the helpers are noted."""
    helpers: list[subprocess.Popen] = []
    start = subprocess.Popen

    def noted(command: list[str], **options: object) -> subprocess.Popen:
        helpers.append(start(command, **options))  # type: ignore[call-overload]
        return helpers[-1]

    monkeypatch.setattr(first_use, "compiled_already", lambda kind: False)
    monkeypatch.setattr(first_use, "cache_is_writable", lambda: True)
    monkeypatch.setattr(subprocess, "Popen", noted)
    return helpers


@pytest.mark.parametrize("number", range(PIECES))
@pytest.mark.parametrize("kind", ["ekf", "ukf"])
def test_a_helper_can_do_its_piece_of_a_real_problem(number, kind) -> None:
    setup = linear_setup(kind)
    pieces = pieces_of(setup)
    assert len(pieces) == PIECES
    piece = pickle.loads(pickle.dumps(pieces[number]))
    (small,) = piece.args
    assert 0 < len(small.records) <= warm_up.FEW
    shortest = min(len(record) for _, record in setup.records.values())
    assert min(len(record) for _, record in small.records.values()) == shortest
    piece()


def test_one_helper_a_piece_and_each_gets_to_its_end(cold) -> None:
    compile_first(linear_setup())
    assert [helper.args[1:] for helper in cold] == [["-m", "auvident.first_use"]] * PIECES
    assert [helper.returncode for helper in cold] == [0] * PIECES


def test_a_helper_that_cannot_run_costs_nothing(cold, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "executable", "/bin/false")
    compile_side_by_side(pieces_of(linear_setup()))
    assert [helper.returncode for helper in cold] == [1] * PIECES


def test_whoever_waited_for_another_compiler_does_not_compile_again(cold, monkeypatch) -> None:
    answers = iter([False, True])  # not compiled; then, with the lock, done by another process
    monkeypatch.setattr(first_use, "compiled_already", lambda kind: next(answers))
    compile_first(linear_setup())
    assert cold == []


def test_no_helper_once_compiled_nor_where_nothing_is_kept(cold, monkeypatch) -> None:
    compile_first(replace(linear_setup(), engine="filterpy"))
    monkeypatch.setattr(first_use, "cache_is_writable", lambda: False)
    compile_first(linear_setup())
    monkeypatch.setattr(first_use, "cache_is_writable", lambda: True)
    monkeypatch.setattr(first_use, "compiled_already", lambda kind: True)
    compile_first(linear_setup())
    assert cold == []


CALLED = """
import pickle, sys
from auvident.estimation import coloured
from auvident.physics import dynamics, fleet

for piece in pickle.load(sys.stdin.buffer):
    piece()
called = {
    coloured: ["_distances", "whiten", "whiten_channels"],
    dynamics: ["simulate_with_sensitivities", "step"],
    fleet: ["_felt", "_rates", "_step", "_turn"],
}
print([n for module, names in called.items() for n in names if not getattr(module, n).signatures])
"""


def test_the_pieces_call_what_the_stages_after_an_identification_need() -> None:
    """After `warm-up` a first validation compiled for five seconds more."""
    told = pickle.dumps(pieces_of(linear_setup()))
    done = subprocess.run([sys.executable, "-c", CALLED], input=told, capture_output=True)
    assert (done.stdout.decode().strip(), done.returncode) == ("[]", 0), done.stderr.decode()
