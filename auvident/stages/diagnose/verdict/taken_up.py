"""Effects that show as coefficients far from the estimate, because the model has room for them."""

from dataclasses import dataclass

from auvident.physics.terms import symbol_in
from auvident.schema.artifacts import Finding
from auvident.schema.planes import Plane
from auvident.stages.diagnose.select.candidates import Traced


@dataclass(frozen=True)
class TakenUp:
    """Coefficients that take an effect up.

    Attributes
    ----------
    code, text : str
        Of the finding; the text may name the ``{motion}`` of the plane.
    generic : tuple of str
        Coefficients, with generic axes: those of either plane.
    least : float
        How many prior standard deviations away they must all be.
    """

    code: str
    text: str
    generic: tuple[str, ...]
    least: float


TAKEN_UP = (
    TakenUp(
        "cross-flow",
        "the cross-flow drag is larger than estimated from geometry",
        ("A_a|a|", "B_b|b|"),
        1.0,
    ),
    TakenUp(
        "turning-drag",
        "the drag {motion} is larger than estimated from geometry",
        ("X_aa", "X_bb"),
        1.0,
    ),
)
MOTION: dict[Plane, str] = {"horizontal": "in turns", "vertical": "while pitching"}
TWICE = 1.7  # ... and how many times the estimate


def coefficient_findings(traced: Traced) -> list[Finding]:
    """Findings on the coefficients of the fit that the diagnosis ends with."""
    found = []
    for row in TAKEN_UP:
        symbols = [symbol_in(traced.case.plane.name, generic) for generic in row.generic]
        ratios = {symbol: _ratio(traced, symbol, row.least) for symbol in symbols}
        if min(ratios.values()) > TWICE:
            text = row.text.format(motion=MOTION[traced.case.plane.name])
            found.append(_finding(row.code, text, ratios))
    return found


def _ratio(traced: Traced, symbol: str, least: float) -> float:
    """A coefficient over its estimate; zero where it is near, or the estimate is zero."""
    case = traced.case
    i = case.position(symbol)
    value, prior = traced.final.parameters[i], case.setup.prior[i]
    away = (value - prior) / case.setup.prior_std[i]
    return float(value / prior) if abs(away) > least and prior != 0.0 else 0.0


def _finding(code: str, text: str, ratios: dict[str, float]) -> Finding:
    listed = ", ".join(f"{symbol} {ratio:.1f} times as large" for symbol, ratio in ratios.items())
    return Finding(
        code=code,
        where=", ".join(ratios),
        value=min(ratios.values()),
        threshold=TWICE,
        message=f"{text}: in the fit of the diagnosis {listed}",
        remedy="The coefficients of the model account for it; no effect needs to be added.",
    )
