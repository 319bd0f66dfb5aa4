"""Modules that the stages to come need, loaded while something else is waited for."""

from collections.abc import Iterable
from importlib import import_module

# by the helper while this process looks for the logs
OF_INGEST = ("auvident.storage.logs", "auvident.stages.ingest")
# by this process while the helper reads the logs
OF_STAGES = (
    "pandas",
    "auvident.stages.segment",
    "auvident.stages.ase",
    "auvident.stages.identify",
    "auvident.stages.diagnose",
    "auvident.stages.refine",
    "auvident.stages.validate",
    "auvident.stages.desk",
    "scipy.optimize",
)
# before there is a helper, or it is renewed, as both draw
OF_REPORT = (
    "jinja2",
    "pandas",
    "auvident.report.html",
    "auvident.report.figures_coefficients",
    "auvident.report.figures_evidence",
    "auvident.report.figures_innovations",
    "auvident.report.figures_loop",
    "auvident.report.figures_prediction",
    "auvident.report.figures_trial",
    "auvident.report.page_figure",
)


def load(modules: Iterable[str]) -> None:
    """Import modules; nothing is done with them yet."""
    for module in modules:
        import_module(module)
