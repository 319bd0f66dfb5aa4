"""What several test modules share: the command line in this process, one completed run."""

import contextlib
import io
import os
import shutil
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
SAMPLES = ROOT / "sample_logs"
PROGRAM = Path(sys.executable).with_name("auvident")
ENVIRONMENT = {
    **os.environ,
    "PYTHONPATH": str(ROOT),
    "PATH": f"{PROGRAM.parent}:{os.environ['PATH']}",
}


@dataclass(frozen=True)
class Called:
    """What a command left: exit code, standard output, standard error."""

    code: int
    out: str
    err: str


def call(*arguments: object) -> Called:
    """Run the command line in this process, where everything is imported already."""
    from auvident.cli import main

    out, err = (io.TextIOWrapper(io.BytesIO(), encoding="utf-8", write_through=True) for _ in "ab")
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            main([str(a) for a in arguments])
        except SystemExit as left:
            code = int(left.code or 0)
    texts = [stream.buffer.getvalue().decode() for stream in (out, err)]  # type: ignore[attr-defined]
    return Called(code, *texts)


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
            "run", "sample_logs/harbour_trial", "--vehicle", "sample_logs/remus100.toml",
            "--run", "runs/demo",
        )  # fmt: skip
    assert done.code == 0, done.err
    return folder


@pytest.fixture
def demo(completed: Path, tmp_path: Path) -> Iterator[Path]:
    """A copy of the finished run to work on, as ``runs/demo`` of the current folder."""
    (tmp_path / "sample_logs").symlink_to(SAMPLES)
    shutil.copytree(completed / "runs", tmp_path / "runs")
    with contextlib.chdir(tmp_path):
        yield Path("runs/demo")
