"""What several test modules share: the command line and one completed run."""

import contextlib
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests import loop_world
from tests.command_line import ROOT, SAMPLES, Called, call


@pytest.fixture
def auvident() -> Callable[..., Called]:
    return call


@pytest.fixture(scope="session")
def completed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with ``sample_logs`` and ``runs/demo``, a finished run; not to be written to."""
    folder = tmp_path_factory.mktemp("completed")
    (folder / "sample_logs").symlink_to(SAMPLES)
    (folder / "README.md").symlink_to(ROOT / "README.md")
    with contextlib.chdir(folder):
        done = call(
            "run",
            "sample_logs/harbour_trial",
            "--vehicle",
            "sample_logs/remus100.toml",
            "--run",
            "runs/demo",
        )
    assert done.code == 0, done.err
    return folder


@pytest.fixture
def demo(completed: Path, tmp_path: Path) -> Iterator[Path]:
    """A copy of the finished run to work on, as ``runs/demo`` of the current folder."""
    (tmp_path / "sample_logs").symlink_to(SAMPLES)
    shutil.copytree(completed / "runs", tmp_path / "runs")
    with contextlib.chdir(tmp_path):
        yield Path("runs/demo")


@pytest.fixture
def quick_loop(monkeypatch: pytest.MonkeyPatch) -> loop_world.HandMade:
    """`diagnose` and `refine` by hand-made stages that find nothing, for tests of the others."""
    return loop_world.put_in_place(monkeypatch, loop_world.nothing)
