"""The command line for tests: in this process, or as a program."""

import contextlib
import io
import os
import sys
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SAMPLES = ROOT / "sample_logs"
PROGRAM = Path(sys.executable).with_name("auvident")
ENVIRONMENT = {
    **{name: value for name, value in os.environ.items() if name != "COLUMNS"},
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
