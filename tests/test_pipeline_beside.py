"""A run of two processes: the same bytes, the same order of things, the same errors."""

import json
import os
import shutil
import subprocess
import sys
from datetime import datetime
from pathlib import Path

import pytest

from auvident import parallel
from tests.command_line import ENVIRONMENT, PROGRAM, SAMPLES, Called

VEHICLE = SAMPLES / "remus100.toml"

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="no copies of processes")


def run(folder: Path, *arguments: object, threads: int) -> Called:
    """``auvident run`` with so many threads; two of them have a second process."""
    command = [str(PROGRAM), "run", *map(str, arguments), "--run", str(folder)]
    environment = {**ENVIRONMENT, parallel.VARIABLE: str(threads)}
    done = subprocess.run(command, capture_output=True, text=True, env=environment)
    return Called(done.returncode, done.stdout, done.stderr)


def manifest(folder: Path) -> dict[str, dict]:
    return json.loads((folder / "run.json").read_text())["stages"]


def test_what_two_processes_make_is_what_one_makes(tmp_path: Path) -> None:
    made = {}
    for threads in (1, 2):
        folder = tmp_path / f"of-{threads}" / "run"
        done = run(folder, SAMPLES / "harbour_trial", "--vehicle", VEHICLE, threads=threads)
        assert done.code == 0, done.err
        made[threads] = manifest(folder)
    one, two = made[1], made[2]
    assert list(one) == list(two)
    for stage, entry in one.items():
        assert entry["outcome"] == two[stage]["outcome"]
        if stage != "report":  # which tells when the stages ran
            assert entry["outputs"] == two[stage]["outputs"], stage
    began, ended = (
        {n: datetime.fromisoformat(e[key]) for n, e in two.items()}
        for key in ("started_at", "ended_at")
    )
    # beside each other, and the report once everything is there
    assert began["diagnose"] < ended["validate"] < ended["diagnose"]
    assert max(ended[n] for n in two if n != "report") <= began["report"]
    assert datetime.fromisoformat(one["validate"]["ended_at"]) <= datetime.fromisoformat(
        one["diagnose"]["started_at"]
    )


def test_what_the_second_process_refuses_is_told_as_ever(tmp_path: Path) -> None:
    """A log without a needed channel, and one without a maneuver."""
    short = tmp_path / "short"
    shutil.copytree(SAMPLES / "harbour_trial", short)
    for file in short.iterdir():
        lines = file.read_text().splitlines()
        file.write_text("\n".join(lines[: 1 + len(lines) // 60]) + "\n")
    blind = tmp_path / "blind"
    shutil.copytree(SAMPLES / "harbour_trial", blind)
    os.remove(blind / "rpm.csv")
    for logs in (blind, short):
        told = [
            run(tmp_path / f"of-{threads}", logs, "--vehicle", VEHICLE, threads=threads)
            for threads in (1, 2)
        ]
        one, two = ((t.code, t.err.replace(f"of-{n}", "run")) for n, t in enumerate(told, 1))
        assert one[0] == two[0] == 3, told
        assert one[1].splitlines()[-2:] == two[1].splitlines()[-2:]
