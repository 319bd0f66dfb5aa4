"""Ingest: every sensor of a trial cleaned and on one clock, with a report on its quality."""

from auvident.stages.ingest.copies import Fingerprint, fingerprint, without_copies
from auvident.stages.ingest.derived import stated_noise_for
from auvident.stages.ingest.fixes import CorrectedTrial, ingest_fixed, refuse_unproposed
from auvident.stages.ingest.stage import ingest

__all__ = [
    "CorrectedTrial",
    "Fingerprint",
    "fingerprint",
    "ingest",
    "ingest_fixed",
    "refuse_unproposed",
    "stated_noise_for",
    "without_copies",
]
