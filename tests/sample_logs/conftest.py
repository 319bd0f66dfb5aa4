"""The generator is a script folder, not a package of the program: put it on the path."""

import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SAMPLES = ROOT / "sample_logs"
TRUTH = ROOT / "tests" / "truth"
sys.path.insert(0, str(SAMPLES))


@pytest.fixture
def samples() -> Path:
    return SAMPLES


@pytest.fixture
def truth_folder() -> Path:
    return TRUTH


@pytest.fixture
def recipe():
    def read(trial: str) -> dict:
        return tomllib.loads((TRUTH / f"{trial}.toml").read_text(encoding="utf-8"))

    return read
