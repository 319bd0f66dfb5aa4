"""Helpers that compile: what they run, when they are called, and that they may fail."""

import pickle
import subprocess
import sys
from dataclasses import replace

import pytest

from auvident.engines import first_use
from auvident.engines.first_use import PARTS, compile_side_by_side
from tests.engines.test_estimator import linear_setup


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


@pytest.mark.parametrize("part", sorted(PARTS))
@pytest.mark.parametrize("kind", ["ekf", "ukf"])
def test_a_helper_can_run_its_part_of_a_real_problem(part, kind) -> None:
    setup = linear_setup(kind)
    small = pickle.loads(pickle.dumps(first_use._shortest(setup)))
    assert 0 < len(small.records) <= first_use.FEW
    shortest = min(len(record) for _, record in setup.records.values())
    assert min(len(record) for _, record in small.records.values()) == shortest
    PARTS[part](small)


def test_one_helper_a_part_and_each_gets_to_its_end(cold) -> None:
    compile_side_by_side(linear_setup())
    assert [helper.args[1:] for helper in cold] == [
        ["-m", "auvident.engines.first_use", part] for part in PARTS
    ]
    assert [helper.returncode for helper in cold] == [0] * len(PARTS)


def test_a_helper_that_cannot_run_costs_nothing(cold, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "executable", "/bin/false")
    compile_side_by_side(linear_setup())
    assert [helper.returncode for helper in cold] == [1] * len(PARTS)


def test_no_helper_once_compiled_nor_where_nothing_is_kept(cold, monkeypatch) -> None:
    compile_side_by_side(replace(linear_setup(), engine="filterpy"))
    monkeypatch.setattr(first_use, "cache_is_writable", lambda: False)
    compile_side_by_side(linear_setup())
    monkeypatch.setattr(first_use, "cache_is_writable", lambda: True)
    monkeypatch.setattr(first_use, "compiled_already", lambda kind: True)
    compile_side_by_side(linear_setup())
    assert cold == []
