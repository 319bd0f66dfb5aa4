"""The figures of the report as matplotlib axes."""

import io
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any

from matplotlib.figure import SubplotParams
from matplotlib.gridspec import GridSpec

from auvident.errors import UsageError
from auvident.report.figures import style
from auvident.report.taken import taken

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from auvident.report.html_data import ReportData

DPI = 100
MANY_NAMES = 15  # along an axis: they stand on end
PAPER = "white"  # a notebook may be dark


class Panels(tuple["Axes", ...]):
    """The matplotlib axes of one figure, from top to bottom; a notebook shows them as a picture.

    A tuple: ``panels[0].set_title("...")``. The figure belongs to nobody else (it is not one of
    pyplot's), so that nothing has to be closed.
    """

    @property
    def figure(self) -> "Figure":
        """The whole figure: ``panels.figure.savefig("held_out.svg")``."""
        found: Figure = self[0].figure  # type: ignore[assignment]
        return found

    def _repr_png_(self) -> bytes:
        stream = io.BytesIO()
        with style():
            self.figure.savefig(stream, format="png", dpi=DPI, bbox_inches="tight")
        return stream.getvalue()

    def __repr__(self) -> str:
        return f"<{len(self)} panels: use .figure to save or to show them>"


def drawn(draw: Callable[..., Any], *arguments: Any) -> Panels:
    """What a function of the report draws, as it is before it is written.

    Raises
    ------
    UsageError
        There is nothing to draw.
    """
    with style(), taken() as figures:
        draw(*arguments)
    if not figures:
        raise UsageError("there is nothing to draw", "plot", "The run has no such results.")
    figure = figures[0]
    with style():
        _lay_out(figure)
    return Panels(figure.axes)


def _lay_out(figure: "Figure") -> None:
    """Paper, and room for the words, which stand beside the panels on the page of the report."""
    figure.set_facecolor(PAPER)
    for axes in figure.axes:
        if len(axes.get_xticks()) >= MANY_NAMES:
            axes.tick_params(axis="x", labelrotation=90)
    places = [axes.get_subplotspec() for axes in figure.axes]
    tops = [place.get_topmost_subplotspec() for place in places if place is not None]
    grids = [top.get_gridspec() for top in tops]
    placed = any(isinstance(g, GridSpec) and g.locally_modified_subplot_params() for g in grids)
    moved = vars(figure.subplotpars) != vars(SubplotParams())
    if len(tops) == len(places) and not placed and not moved:  # nobody has laid it out
        figure.tight_layout()
    figure.align_ylabels()


class Plots:
    """The figures of a run, each as the matplotlib axes of one figure; see `Run.plot`."""

    def __init__(self, planes: Callable[[], "tuple[ReportData, ...]"]) -> None:
        self._planes = planes

    def held_out(self, maneuver: str | None = None) -> Panels:
        """A held-out maneuver: measured, predicted by estimate, identified and refined model.

        Parameters
        ----------
        maneuver : str, optional
            Its id; by default the first one of the run.
        """
        from auvident.report.figures_prediction import prediction
        from auvident.report.html_loop import with_refined

        held = {m.id: (data, m) for data in self._planes() for m in data.held_out()}
        data, found = _chosen(held, maneuver)
        assert data.simulation is not None
        rows = data.simulation[data.simulation["maneuver"] == found.id]
        rows = with_refined(rows, data, found.id)
        return drawn(prediction, rows, found, data.before(found.id), "held_out", data.prior_name)

    def coefficients(self, plane: str | None = None) -> Panels:
        """Coefficients of the final model against their prior, and the share from the data."""
        from auvident.report.figures_coefficients import forest

        return drawn(forest, _model(self._of(plane)).estimates, "coefficients")

    def correlations(self, plane: str | None = None) -> Panels:
        """Correlations of the coefficients of the final model."""
        from auvident.report.figures_coefficients import correlation_matrix

        return drawn(correlation_matrix, _model(self._of(plane)).covariance, "correlations")

    def history(self, plane: str | None = None) -> Panels:
        """Every coefficient through the stages and cycles of the identification."""
        from auvident.report.figures_coefficients import history

        data = self._of(plane)
        return drawn(history, data.final_history, _model(data).estimates, "history")

    def trial(self, trial: str | None = None) -> Panels:
        """Channels of a trial over time, with its maneuvers; of the first one without a name."""
        from auvident.report.figures_trial import timeline

        data = self._of(None)
        found = _chosen({t.name: t for t in data.trials}, trial)
        return drawn(timeline, [found], _maneuvers(data), "trial")

    def track(self, trial: str | None = None) -> Panels:
        """Tracks of the trials with their maneuvers, north up; or of one of them."""
        from auvident.report.figures_trial import track

        data = self._of(None)
        own = {t.name: t for t in data.trials}
        trials = list(own.values()) if trial is None else [_chosen(own, trial)]
        return drawn(track, trials, _maneuvers(data), "track")

    def residuals(self, plane: str | None = None) -> Panels:
        """The most affected channels, measured and predicted, with the residuals."""
        from auvident.report.figures_loop import before_after

        return drawn(before_after, _residuals(self._of(plane)), "residuals")

    def forces(self, plane: str | None = None) -> Panels:
        """The force that would explain the residual, against what it may follow."""
        from auvident.report.figures_forces import unknown_force

        return drawn(unknown_force, _residuals(self._of(plane)), "forces")

    def candidates(self, plane: str | None = None) -> Panels:
        """What each effect that was tried would gain in log-likelihood."""
        from auvident.report.figures_loop import gains

        data = self._of(plane)
        found = data.comparison or data.diagnosis
        if found is None:
            raise _not_diagnosed()
        return drawn(gains, found.candidates, "candidates")

    def _of(self, plane: str | None) -> "ReportData":
        """Results of a plane, of the first one without a name."""
        return _chosen({data.plane: data for data in self._planes()}, plane)


def _chosen(known: dict[str, Any], name: str | None) -> Any:
    """The one of a name; the first one without."""
    if name is None and known:
        return next(iter(known.values()))
    if name not in known:
        raise UsageError(
            f"there is no {name!r}" if name else "there is nothing to draw",
            "plot",
            f"Known: {', '.join(known)}." if known else "The run has no such results.",
        )
    return known[name]


def _model(data: "ReportData") -> Any:
    assert data.final_model is not None
    return data.final_model


def _maneuvers(data: "ReportData") -> Iterable[Any]:
    return data.maneuvers.maneuvers if data.maneuvers else ()


def _residuals(data: "ReportData") -> Any:
    if data.residuals is None:
        raise _not_diagnosed()
    return data.residuals


def _not_diagnosed() -> UsageError:
    return UsageError("the run has no diagnosis", "plot", "Run `auvident diagnose RUN`.")
