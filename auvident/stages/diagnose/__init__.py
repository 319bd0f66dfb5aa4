"""Diagnosis: what a model leaves of its trial, and the effect behind it."""

from auvident.stages.diagnose.checks.other_plane import told_by
from auvident.stages.diagnose.stage import Diagnosed, diagnose

__all__ = ["Diagnosed", "diagnose", "told_by"]
