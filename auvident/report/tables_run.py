"""Tables of the logs, the maneuvers and the predictions; for the terminal and for the page."""

from collections.abc import Mapping, Sequence
from typing import Any

from auvident.report.tables import (
    Cell,
    Column,
    Fixed,
    Joined,
    Nrmse,
    Number,
    Quantity,
    Rmse,
    Rows,
    Table,
    Unit,
    WithStd,
    beside,
    columns,
)
from auvident.schema.artifacts import (
    ChannelMetrics,
    CrossValidation,
    Maneuver,
    Metrics,
    ResidualTests,
)
from auvident.schema.diagnosis import ChannelError
from auvident.schema.logs import SensorQuality, TrialQuality
from auvident.schema.planes import BY_PLANE
from auvident.schema.spin import share

RESIDUALS_CAPTION = (
    "Bias, variance and covariance are shares of the squared error. NIS, KS and lags outside the "
    "95 % band are of the residual whitened with the noise of the identifying maneuvers: 1, 0 and "
    "5 % where noise is all that is left. * marks a correlation beyond its 95 % band."
)

Errors = Mapping[str, ChannelMetrics | ChannelError]


def trials(found: Sequence[TrialQuality], known: Sequence[Maneuver] | None = None) -> Table:
    """One row a trial; with its maneuvers once these are known."""
    rows = [
        [
            t.trial,
            t.origin[:10],
            left_out(t.sensors),
            str(t.samples),
            f"{t.rate_hz:g}",
            f"{t.t_end_s - t.t_start_s:.1f}",
            str(len(t.records)),
            *_counts(t.trial, known),
        ]
        for t in found
    ]
    numbers = ["rows", "Hz", "length, s", "records"]
    numbers += ["maneuvers", "held out"] if known is not None else []
    heads = columns(("trial", "date", "values left out"), tuple(numbers))
    return Table(heads, rows, "Trials")


def maneuvers_by_trial(found: Sequence[Maneuver]) -> Table:
    """How many maneuvers each trial gives."""
    rows: Rows = [[name, *_counts(name, found)] for name in dict.fromkeys(m.trial for m in found)]
    return Table(columns(("trial",), ("maneuvers", "held out")), rows, "Maneuvers by trial")


def _counts(trial: str, known: Sequence[Maneuver] | None) -> list[Cell]:
    roles = [m.role for m in known or () if m.trial == trial]
    return [str(len(roles)), str(roles.count("validate"))] if known is not None else []


def sensors(found: Sequence[TrialQuality], title: str = "") -> Table:
    """What became of every sensor's rows."""
    rows = [[t.trial, *_sensor(s)] for t in found for s in t.sensors]
    heads = (
        Column("trial", on_page=True),
        *columns(("sensor", "values left out")),
        Column("noise", on_page=True),
        *columns(numbers=("rows", "used", "Hz")),
        Column("jitter, ms", numeric=True, on_page=True),
        Column("gaps", numeric=True),
        Column("longest gap, s", numeric=True, on_page=True),
    )
    return Table(heads, rows, title)


def _sensor(s: SensorQuality) -> list[Cell]:
    noise = [
        Joined((c.log_column, Quantity(c.noise_std, c.unit, 2)), " ")
        for c in s.channels
        if c.noise_std
    ]
    longest = max((c.longest_gap_s for c in s.channels), default=0.0)
    made = dict.fromkeys(c.source for c in s.channels if c.source != "logged")
    return [
        f"{s.sensor} ({', '.join(made)})" if made else s.sensor,
        left_out((s,)),
        Joined(noise),
        str(s.rows_read),
        str(s.rows_used),
        Number(s.rate_hz),
        Fixed(None if s.jitter_s is None else 1000.0 * s.jitter_s, ".1f"),
        str(max((c.gaps for c in s.channels), default=0)),
        Number(longest, 2),
    ]


def left_out(found: Sequence[SensorQuality]) -> str:
    """How many samples were left out, by reason."""
    count: dict[str, int] = {}
    for where in (d for s in found for d in (s.dropped, *(c.dropped for c in s.channels))):
        for reason, dropped in where.items():
            count[reason] = count.get(reason, 0) + dropped.count
    return ", ".join(f"{n} {reason.replace('_', ' ')}" for reason, n in count.items())


def maneuvers(found: Sequence[Maneuver], title: str = "") -> Table:
    """Maneuvers with what characterises them."""
    heads = (
        *columns(("maneuver", "kind", "role")),
        Column("what", on_page=True),
        *columns(numbers=("from, s", "to, s", "length, s")),
        Column("std u, m/s", numeric=True, on_page=True),
        Column("std r or q, deg/s", numeric=True, on_page=True),
    )
    return Table(heads, [_maneuver(m) for m in found], title, mark="validate")


def _maneuver(m: Maneuver) -> list[Cell]:
    excitation = m.features.get("excitation") or {}
    rate = excitation.get(f"{BY_PLANE[m.plane].velocities[2]}_std_degps")
    return [
        m.id,
        _kind(m),
        m.role,
        _what(m),
        f"{m.t_start_s:.1f}",
        f"{m.t_end_s:.1f}",
        f"{m.t_end_s - m.t_start_s:.1f}",
        Number(excitation.get("u_std_mps"), 2),
        Number(rate, 2),
    ]


def kinds_of(found: Sequence[Maneuver]) -> dict[str, str]:
    """What each maneuver is called, by its id."""
    return {m.id: _kind(m) for m in found}


def _kind(m: Maneuver) -> str:
    """Its kind; a straight run that changes the depth by its other name."""
    return "depth step" if m.features.get("maneuver") == "depth_step" else m.kind


def _what(m: Maneuver) -> Joined:
    """A maneuver in a few words, from those of its features that it has."""
    f = m.features
    fin = BY_PLANE[m.plane].fin
    speeds = f.get("steady_speed_mps")
    pieces: list[Cell] = [
        _feature(f.get("approach_speed_mps"), "", " m/s"),
        _feature(f.get(f"{fin}_deg"), "", f"° {fin}"),
        f"to {f['side']}" if f.get("side") else "",
        _feature(f.get("steady_diameter_m"), "diameter ", " m"),
        f"{f['executes']} executes" if f.get("executes") else "",
        _feature(f.get("overshoot_1_deg"), "1st overshoot ", "°"),
        _feature(f.get("period_s"), "period ", " s"),
        ", ".join(f"{x:.0f}" for x in f["rpm_levels"]) + " rpm" if f.get("rpm_levels") else "",
    ]
    if speeds and isinstance(speeds, list):
        pieces.append(Joined((Joined([Number(x) for x in speeds]), "m/s"), " "))
    return Joined(pieces)


def _feature(value: float | None, before: str, behind: str) -> Cell:
    return Number(value, before=before, behind=behind) if value else ""


def errors_by_channel(
    title: str,
    after: Mapping[str, ChannelMetrics],
    before: Mapping[str, ChannelMetrics],
    crossed: Mapping[str, CrossValidation] | None = None,
    prior: str = "ASE",
) -> Table:
    """Errors of the prediction by channel: estimate from geometry, identified model.

    Parameters
    ----------
    crossed : mapping, optional
        Errors of the identifying maneuvers left out in turn, for a column beside.
    prior : str
        What it is compared with, a key of `PRIOR_WORDS`.
    """
    rows: Rows = [
        [
            name,
            Unit(a.unit, True),
            Rmse(b),
            Rmse(a),
            *([Rmse(crossed.get(name))] if crossed else ()),
            Nrmse(name, b),
            Nrmse(name, a),
            Fixed(None if share(name, a.rmse, a.nrmse) is None else a.r2, ".3f"),
        ]
        for name, a in after.items()
        for b in [before.get(name)]
    ]
    heads = [f"RMSE, {prior}", "RMSE, identified", f"NRMSE, {prior}", "NRMSE, identified", "R²"]
    heads[2:2] = ["RMSE, cross-validation"] if crossed else []
    return Table(columns(("channel", "unit"), heads), rows, title)


def errors_by_horizon(metrics: Metrics, title: str = "") -> Table:
    """Errors of the held-out maneuvers in windows of some lengths, and free-running, by channel."""
    free = metrics.summary.get("validate", {})
    columns_of = [*metrics.horizons.values(), free]
    rows: Rows = [
        [
            name,
            Unit(a.unit, True),
            *(Rmse(c.get(name)) for c in columns_of),
            *(Nrmse(name, c.get(name), a) for c in columns_of),
        ]
        for name, a in free.items()
    ]
    ways = [*(f"{horizon} s" for horizon in metrics.horizons), "free-running"]
    heads = [f"{what}, {way}" for what in ("RMSE", "NRMSE") for way in ways]
    return Table(columns(("channel", "unit"), heads), rows, title)


def errors_by_maneuver(
    metrics: Metrics,
    final: Mapping[str, Errors] | None = None,
    kinds: Mapping[str, str] | None = None,
) -> Table:
    """RMSE of every maneuver and channel, that with the prior in brackets.

    Parameters
    ----------
    metrics : Metrics
    final : mapping, optional
        Errors of another model than the identified one, by maneuver.
    kinds : mapping, optional
        What each maneuver is called, see `kinds_of`.
    """
    before = {m.id: m.channels for m in metrics.ase.maneuvers} if metrics.ase else {}
    units = {name: c.unit for m in metrics.maneuvers for name, c in m.channels.items()}
    rows: list[list[Cell]] = []
    for m in sorted(metrics.maneuvers, key=lambda m: m.role != "validate"):
        after = (final or {}).get(m.id, m.channels)
        errors = (_beside(after.get(n), before.get(m.id, {}).get(n)) for n in units)
        kind = (kinds or {}).get(m.id, m.kind)
        rows.append([m.id, kind, m.role, f"{m.duration_s:.0f}", *errors])
    heads = (
        *columns(("maneuver", "kind", "role"), ("length, s",)),
        *(Column(name, unit, numeric=True) for name, unit in units.items()),
    )
    return Table(heads, rows, mark="validate")


def _beside(after: ChannelMetrics | ChannelError | None, before: ChannelMetrics | None) -> Cell:
    if after is None:
        return Number(None)
    return beside(after.rmse, before.rmse if before else None, after.unit, 2)


def residuals(metrics: Metrics, title: str = "") -> Table:
    """Residual analysis by channel, held-out maneuvers first."""
    roles = sorted(metrics.residuals, key=lambda role: role != "validate")
    rows: Rows = [
        [role, channel, *_shares(tests), *_innovations(tests), _with_inputs(tests)]
        for role in roles
        for channel, tests in metrics.residuals[role].items()
    ]
    heads = columns(
        ("role", "channel"),
        ("Theil U", "bias", "variance", "covariance", "NIS", "KS", "lags outside"),
    )
    last = Column("largest correlation with an input (its lag)")
    return Table((*heads, last), rows, title, RESIDUALS_CAPTION, mark="validate")


def _shares(tests: ResidualTests) -> list[Cell]:
    t = tests.theil
    shares = (t.bias, t.variance, t.covariance) if t else (None,) * 3
    return [
        Number(t.coefficient if t else None),
        *(Fixed(None if x is None else 100.0 * x, ".0f", " %") for x in shares),
    ]


def _innovations(tests: ResidualTests) -> list[Cell]:
    nis, white = tests.nis, tests.autocorrelation
    if nis is None:
        return ["", "", ""]
    outside = 100.0 * white.outside if white else None
    return [Number(nis.mean, 2), Number(nis.ks, 2), Fixed(outside, ".0f", " %")]


def _with_inputs(tests: ResidualTests) -> Cell:
    """Correlation with each input and its lag; a star where it is beyond its band."""
    found = []
    for name, c in tests.inputs.items():
        lag = Fixed(c.lag_s, ".1f", " s)" + "*" * (abs(c.largest) > c.band))
        found.append(Joined((name, Fixed(c.largest, "+.2f"), Joined(("(", lag), "")), " "))
    return Joined(found)


def runs_side_by_side(compared: Mapping[str, Any]) -> list[Table]:
    """Coefficients, effects and held-out errors of several runs; those that there are."""
    names = [str(run["run"]) for run in compared["runs"]]
    values: Rows = [
        [r["symbol"], r["unit"], *_values(r), Number(r["apart"], 2)]
        for r in compared["coefficients"]
    ]
    effects: Rows = [[r["symbol"], r["unit"], *_values(r)] for r in compared["effects"]]
    errors: Rows = [
        [r["channel"], Unit(r["unit"], converted=True), *_errors(r)] for r in compared["held_out"]
    ]
    heads = columns(("", "unit"), names)
    first = Table(
        (*heads, *columns(numbers=("difference, std",))), values, "Coefficients (value ± std)"
    )
    others = (
        Table(heads, effects, "Added effects (value ± std)"),
        Table(heads, errors, "Held-out error, RMSE (NRMSE)"),
    )
    return [first, *(table for table in others if table.rows)]


def _values(row: Mapping[str, Any]) -> list[Cell]:
    """Value and standard deviation of every run; empty where it has none."""
    pairs = zip(row["value"], row["std"], strict=True)
    return ["" if value is None else WithStd(value, std) for value, std in pairs]


def _errors(row: Mapping[str, Any]) -> list[Cell]:
    """Error and normalised error of every run; empty where it has none."""
    pairs = zip(row["rmse"], row["nrmse"], strict=True)
    return ["" if rmse is None else _error(row, rmse, nrmse) for rmse, nrmse in pairs]


def _error(row: Mapping[str, Any], rmse: float, nrmse: float | None) -> Cell:
    """``RMSE (NRMSE)`` of a channel; the first alone for a heading that turned round and round."""
    own, part = Number(rmse, 3, row["unit"]), share(row["channel"], rmse, nrmse)
    return own if part is None else Joined((own, Number(part, 3, before="(", behind=")")), " ")
