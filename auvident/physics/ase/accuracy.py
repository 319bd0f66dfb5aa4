"""How accurate each formula is, and how that spreads to the coefficients.

Each entry is one independent normal deviate z of one formula, not of one coefficient: the same
deviate acts on every coefficient that the formula enters, so the spread of the coefficients is
correlated as it is in nature. A ``scale`` multiplies by exp(sigma z); a ``shift`` adds sigma z to
a nominal value, in the unit that the entry states. Where no measurement was at hand the source
says ``judgement``.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Accuracy:
    """Accuracy of one formula: 1-sigma of its logarithm (scale) or of its offset (shift)."""

    name: str
    sigma: float
    source: str


# fmt: off
ACCURACIES: tuple[Accuracy, ...] = (
    Accuracy("surge_spheroid", 0.35, "REMUS X_udot -1.38 with equal volume, -0.93 with Prestero's"),
    Accuracy("strip_added_mass", 0.24, "SUBOFF Z_wdot' measured 20-25 % below strips (Roddy 1990)"),
    Accuracy("strip_rotation", 0.15, "SUBOFF M_qdot' 21 % below the hull's strips, 30 % with fins"),
    Accuracy("strip_fins", 0.40, "judgement: strips ignore the ends of fins with A near 2"),
    Accuracy("added_mass_centre", 0.03, "of L, shift: SUBOFF Z_qdot' -0.00063, M_wdot' -0.00056"),
    Accuracy("coriolis", 0.30, "judgement: ideal fluid; nothing measured at hand"),
    Accuracy("slenderness", 0.10, "SUBOFF bare N_v' 2-10 % (theory 8.1); Lamb and DATCOM 1 %"),
    Accuracy("cut_station", 0.10, "of tail, shift: brings SUBOFF bare Y_v' 25 % down to measured"),
    Accuracy("hull_rate_lift", 1.0, "shift, 1 = slender body cut: SUBOFF Y_r' 0.7, N_r' 1.2"),
    Accuracy("friction", 0.08, "SUBOFF resistance 3 %, tolerance 8 % (theory 8.1); ITTC or PS"),
    Accuracy("protuberances", 0.50, "REMUS: C_d beyond hull and fins 0.06 at sea, 0.12 towed"),
    Accuracy("drag_stated", 1.0, "shift: of the standard deviation stated in the file"),
    Accuracy("crossflow_drag", 0.45, "shift of C_D: 0.2-0.8 about the crisis, eta to 1, masts"),
    Accuracy("crossflow_centre", 0.08, "of L, shift, judgement: separation begins aft of the nose"),
    Accuracy("crossflow_turning", 1.25, "shift, 1 = subcritical strips; 1 to 1.6 without eta"),
    Accuracy("suction", 0.60, "shift, 1 = whole; C_A = C_A0 cos^2 of Jorgensen has none"),
    Accuracy("fin_lift", 0.10, "Whicker-Fehlner 2.61, Hoerner 3.12 at A = 2.2: 19 % apart"),
    Accuracy("fin_wake", 0.20, "tail fins, protruding: no-K to K span, theory 8.1"),
    Accuracy("fin_wake_buried", 0.30, "added when the tip is inside the hull's diameter: SUBOFF"),
    Accuracy("fin_incidence", 0.15, "(1+tau)^2 or less, tail fins protruding"),
    Accuracy("fin_incidence_buried", 0.40, "added when buried: SUBOFF planes Y_v' a factor 3.2"),
    Accuracy("fin_deflection", 0.10, "K_W(B): chart to 0.012, gap at the root of a moving fin"),
    Accuracy("fin_centre", 0.25, "of mean chord, shift, judgement: stock or quarter chord"),
    Accuracy("sail_interference", 0.10, "SUBOFF sail Y_v' -2 to +4 %, tolerance 15 % (theory 8.1)"),
    Accuracy("sail_centre", 0.85, "of mean chord, shift aft: SUBOFF sail N_v' 42 % high"),
    Accuracy("fin_drag", 0.35, "C_D0 at Re 1e5: laminar 0.010, turbulent 0.021"),
    Accuracy("fin_induced", 0.35, "K or K^2 (theory 5.1), e = 0.9"),
    Accuracy("fin_stall", 0.50, "shift, of K C_La: bends over at 0.4 rad, -14 % at 0.3 rad"),
    Accuracy("fin_crossflow", 0.45, "C_Dc 0.42 (faired) to 0.82 (square tips) at one taper"),
    Accuracy("thrust_line", 0.12, "judgement: open-water line at another Reynolds number"),
    Accuracy("thrust_slope", 0.15, "judgement: as thrust_line, and a curve that is no line"),
    Accuracy("wake_given", 0.06, "judgement: wake fraction in the file"),
    Accuracy("wake_assumed", 0.20, "judgement: none in the file, 0.1-0.4 behind a hull"),
    Accuracy("deduction_given", 0.05, "judgement: thrust deduction in the file"),
    Accuracy("deduction_assumed", 0.12, "judgement: none in the file, 0.05-0.25 usual"),
)
# fmt: on

BY_NAME: dict[str, Accuracy] = {a.name: a for a in ACCURACIES}


@dataclass(frozen=True)
class Deviation:
    """A draw of the accuracies: normal deviates by name, zero where absent."""

    z: Mapping[str, Any] = field(default_factory=dict)

    def scale(self, name: str, share: Any = 1.0) -> np.ndarray:
        """Factor exp(sigma share z) of a formula; `share` scales sigma with geometry."""
        return np.exp(BY_NAME[name].sigma * np.asarray(share) * np.asarray(self.z.get(name, 0.0)))

    def offset_factor(self, name: str, nominal: Any) -> np.ndarray:
        """Factor by which a positive `nominal` deviates by about sigma z and stays positive."""
        share = np.arcsinh(BY_NAME[name].sigma / np.asarray(nominal, float))
        return np.exp(share * np.asarray(self.z.get(name, 0.0)))

    def shift(self, name: str) -> np.ndarray:
        """Offset sigma z of a formula."""
        return BY_NAME[name].sigma * np.asarray(self.z.get(name, 0.0))


NOMINAL = Deviation()


def one_at_a_time() -> Deviation:
    """The nominal case, then each accuracy one sigma up and one down.

    Returns
    -------
    Deviation
        Deviates of shape (1 + 2 n,), n = len(ACCURACIES): 0, up 1, down 1, up 2, ...
    """
    n = len(ACCURACIES)
    z = np.zeros((n, 1 + 2 * n))
    for i in range(n):
        z[i, 1 + 2 * i], z[i, 2 + 2 * i] = 1.0, -1.0
    return Deviation({a.name: z[i] for i, a in enumerate(ACCURACIES)})
