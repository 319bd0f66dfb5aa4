"""Tests of units, scales, signs and axes of a trial, before anything is identified from it."""

from auvident.stages.ingest.checks.correction import corrected
from auvident.stages.ingest.checks.pitching import with_the_gyro_at_fault
from auvident.stages.ingest.checks.seen import Seen
from auvident.stages.ingest.checks.table import CHECKS, run_checks

__all__ = ["CHECKS", "Seen", "corrected", "run_checks", "with_the_gyro_at_fault"]
