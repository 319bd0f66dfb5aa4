"""What is done, in order? The table of stages; skip or run; read, call, write."""

from auvident.pipeline.freshness import Decision
from auvident.pipeline.observer import Observer
from auvident.pipeline.run import RunResult, run_all, run_stage, status
from auvident.pipeline.table import STAGES, Stage

__all__ = [
    "STAGES",
    "Decision",
    "Observer",
    "RunResult",
    "Stage",
    "run_all",
    "run_stage",
    "status",
]
