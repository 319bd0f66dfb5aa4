"""Ingest: every sensor of a trial cleaned and on one clock, with a report on its quality."""

from auvident.stages.ingest.copies import Fingerprint, fingerprint, refuse_copy
from auvident.stages.ingest.fixes import CorrectedTrial, ingest_fixed, refuse_unproposed
from auvident.stages.ingest.stage import ingest

__all__ = [
    "CorrectedTrial",
    "Fingerprint",
    "fingerprint",
    "ingest",
    "ingest_fixed",
    "refuse_copy",
    "refuse_unproposed",
]
