"""Tests of the limit of time that every study sets."""

import time

import pytest

from tests.bench import population_trial
from tests.bench.population_trial import alarm


def test_what_computes_for_too_long_is_stopped():
    alarm(1)
    began = time.process_time()
    with pytest.raises(TimeoutError, match="not done in 1 s"):
        while time.process_time() - began < 20.0:
            pass
    alarm(0)


def test_waiting_costs_no_time_of_the_processor():
    alarm(1)
    time.sleep(1.5)
    alarm(0)


def test_what_waits_for_ever_is_stopped_as_well(monkeypatch):
    monkeypatch.setattr(population_trial, "WAITING", 1)
    alarm(1)
    with pytest.raises(TimeoutError):
        time.sleep(20.0)
    alarm(0)
