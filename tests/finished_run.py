"""The run that the README begins with: finished once, looked at by many tests."""

import json
import subprocess
from dataclasses import asdict, dataclass
from pathlib import Path

from tests.command_line import ENVIRONMENT, ROOT, SAMPLES, Called

COMMAND = (
    "auvident run sample_logs/harbour_trial --vehicle sample_logs/remus100.toml --run runs/demo"
)
SAID = "said.json"


@dataclass(frozen=True)
class Finished:
    """The folder that has ``sample_logs`` and ``runs/demo``, and what the command left."""

    folder: Path
    called: Called


def shell(command: str, folder: Path) -> Called:
    """A command as a reader types it."""
    done = subprocess.run(
        command, shell=True, cwd=folder, env=ENVIRONMENT, capture_output=True, text=True
    )
    return Called(done.returncode, done.stdout, done.stderr)


def finished_run(folder: Path) -> Finished:
    """The run in this folder; made if it is not there. The caller holds a lock."""
    said = folder / SAID
    if not said.exists():
        (folder / "sample_logs").symlink_to(SAMPLES)
        (folder / "README.md").symlink_to(ROOT / "README.md")
        said.write_text(json.dumps(asdict(shell(COMMAND, folder))))
    return Finished(folder, Called(**json.loads(said.read_text())))
