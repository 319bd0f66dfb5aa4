"""Products of the motion that the equations lack: what a force without a name is made of.

`refine --with-unexplained` takes them together, each with a small prior. A product belongs to no
cause: nothing here is a candidate of `diagnose`.
"""

from dataclasses import dataclass

Factor = tuple[str, str]  # variable and power, as in `auvident.physics.terms`

NAME = "unexplained_force"
DEGREE = {"x": 1, "|x|": 1, "x^2": 2, "x|x|": 2, "x^3": 3}
# of u / U, v / U, r L / U, rudder [rad] and functions of the heading in a usual maneuver
TYPICAL = {"u": 1.0, "a": 0.2, "b": 0.5, "d": 0.25, "sin": 1.0, "cos": 1.0}
# standard deviation that each product gives the force [density/2 L^2 U^2, of N: L^3]
SHARE = {"X": 0.002, "A": 0.005, "B": 0.002}
AXES = {"X": "X", "A": "Y", "B": "N"}
HEADING: dict[str, tuple[Factor, ...]] = {
    "cos": (("cos", "x"),),
    "sin": (("sin", "x"),),
    "coscos": (("cos", "x^2"),),
    "sinsin": (("sin", "x^2"),),
    "sincos": (("sin", "x"), ("cos", "x")),
}
AXIAL: dict[str, tuple[Factor, ...]] = {
    "u": (("u", "x"),),
    "uvd": (("u", "x"), ("a", "x"), ("d", "x")),
    "urd": (("u", "x"), ("b", "x"), ("d", "x")),
}
LATERAL: dict[str, tuple[Factor, ...]] = {
    "v": (("a", "x"),),
    "r": (("b", "x"),),
    "v|r|": (("a", "x"), ("b", "|x|")),
    "r|v|": (("b", "x"), ("a", "|x|")),
    "vvv": (("a", "x^3"),),
    "vvr": (("a", "x^2"), ("b", "x")),
    "vrr": (("a", "x"), ("b", "x^2")),
    "rrr": (("b", "x^3"),),
    "u|v|d": (("u", "x"), ("a", "|x|"), ("d", "x")),
    "u|r|d": (("u", "x"), ("b", "|x|"), ("d", "x")),
    "uud|d|": (("u", "x^2"), ("d", "x|x|")),
}


@dataclass(frozen=True)
class Product:
    """A product on one equation.

    Attributes
    ----------
    symbol, equation : str
    factors : tuple of (variable, power)
    """

    symbol: str
    equation: str
    factors: tuple[Factor, ...]

    @property
    def follows_heading(self) -> bool:
        """Whether it needs a heading that was logged."""
        return any(variable in ("sin", "cos") for variable, _ in self.factors)

    @property
    def powers(self) -> tuple[int, int, int, int]:
        """Its coefficient scales with density/2, length, speed and propeller rate to these."""
        degrees = [(v, DEGREE[power]) for v, power in self.factors]
        turns = sum(n for v, n in degrees if v == "b")
        speeds = sum(n for v, n in degrees if v in ("u", "a", "b"))
        return 1, (3 if self.equation == "B" else 2) + turns, 2 - speeds, 0

    @property
    def unit(self) -> str:
        """Unit of its coefficient."""
        _, length, speed, _ = self.powers
        sized = (("kg", 1), ("m", length + speed - 3), ("s", -speed))
        above, below = (
            " ".join(f"{u}^{abs(n)}" if abs(n) > 1 else u for u, n in sized if n * sign > 0)
            for sign in (1, -1)
        )
        return f"{above}/{below}" if below else above

    @property
    def prior(self) -> float:
        """Standard deviation of its coefficient, in units of `powers`."""
        size = SHARE[self.equation]
        for variable, power in self.factors:
            size /= TYPICAL[variable] ** DEGREE[power]
        return size


PRODUCTS = tuple(
    Product(f"{AXES[equation]}_{name}", equation, factors)
    for equation, own in (("X", AXIAL), ("A", LATERAL), ("B", LATERAL))
    for name, factors in (own | HEADING).items()
)
