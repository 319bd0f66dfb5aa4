"""Trials of one vehicle pooled to one model, and what changed from one to the next."""

from auvident.stages.pool.changes import changes_of
from auvident.stages.pool.collect import PoolTrial
from auvident.stages.pool.stage import PoolResult, pool

__all__ = ["PoolResult", "PoolTrial", "changes_of", "pool"]
