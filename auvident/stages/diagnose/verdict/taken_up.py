"""Effects that show as coefficients far from the estimate, because the model has room for them."""

from dataclasses import dataclass

from auvident.schema.artifacts import Finding
from auvident.stages.diagnose.select.candidates import Traced


@dataclass(frozen=True)
class TakenUp:
    """Coefficients that take an effect up.

    Attributes
    ----------
    code, text : str
        Of the finding.
    symbols : tuple of str
    least : float
        How many prior standard deviations away they must all be.
    """

    code: str
    text: str
    symbols: tuple[str, ...]
    least: float


TAKEN_UP = (
    TakenUp(
        "cross-flow",
        "the cross-flow drag is larger than estimated from geometry",
        ("Y_v|v|", "N_r|r|"),
        1.0,
    ),
    TakenUp(
        "turning-drag",
        "the drag in turns is larger than estimated from geometry",
        ("X_vv", "X_rr"),
        1.0,
    ),
)
TWICE = 1.7  # ... and how many times the estimate


def coefficient_findings(traced: Traced) -> list[Finding]:
    """Findings on the coefficients of the final model."""
    found = []
    for row in TAKEN_UP:
        ratios = {symbol: _ratio(traced, symbol, row.least) for symbol in row.symbols}
        if min(ratios.values()) > TWICE:
            found.append(_finding(row, ratios))
    return found


def _ratio(traced: Traced, symbol: str, least: float) -> float:
    """A coefficient over its estimate; zero where it is near, or the estimate is zero."""
    case = traced.case
    i = case.position(symbol)
    value, prior = traced.final.parameters[i], case.setup.prior[i]
    away = (value - prior) / case.setup.prior_std[i]
    return float(value / prior) if abs(away) > least and prior != 0.0 else 0.0


def _finding(row: TakenUp, ratios: dict[str, float]) -> Finding:
    listed = ", ".join(f"{symbol} {ratio:.1f} times as large" for symbol, ratio in ratios.items())
    return Finding(
        code=row.code,
        where=", ".join(row.symbols),
        value=min(ratios.values()),
        threshold=TWICE,
        message=f"{row.text}: {listed}",
        remedy="The coefficients account for it; no effect needs to be added.",
    )
