"""Products of the motion that the equations lack: what a force without a name is made of.

`refine --with-unexplained` takes them together, each with a small prior. A product belongs to no
cause: nothing here is a candidate of `diagnose`.
"""

from dataclasses import dataclass

from auvident.schema.planes import HORIZONTAL, PLANES, Plane, symbol_in

Factor = tuple[str, str]  # variable and power, as in `auvident.physics.terms`

NAME = "unexplained_force"
DEGREE = {"x": 1, "|x|": 1, "x^2": 2, "x|x|": 2, "x^3": 3}
# of u / U, a / U, b L / U, fin [rad] and functions of the heading in a usual maneuver
TYPICAL = {"u": 1.0, "a": 0.2, "b": 0.5, "d": 0.25, "sin": 1.0, "cos": 1.0}
# standard deviation that each product gives the force [density/2 L^2 U^2, of N: L^3]
SHARE = {"X": 0.002, "A": 0.005, "B": 0.002}
# The pitch is no such angle: weight and buoyancy, which turn with it, are estimated.
HEADING: dict[str, tuple[Factor, ...]] = {
    "cos": (("cos", "x"),),
    "sin": (("sin", "x"),),
    "coscos": (("cos", "x^2"),),
    "sinsin": (("sin", "x^2"),),
    "sincos": (("sin", "x"), ("cos", "x")),
}
AXIAL: dict[str, tuple[Factor, ...]] = {
    "u": (("u", "x"),),
    "uad": (("u", "x"), ("a", "x"), ("d", "x")),
    "ubd": (("u", "x"), ("b", "x"), ("d", "x")),
}
LATERAL: dict[str, tuple[Factor, ...]] = {
    "a": (("a", "x"),),
    "b": (("b", "x"),),
    "a|b|": (("a", "x"), ("b", "|x|")),
    "b|a|": (("b", "x"), ("a", "|x|")),
    "aaa": (("a", "x^3"),),
    "aab": (("a", "x^2"), ("b", "x")),
    "abb": (("a", "x"), ("b", "x^2")),
    "bbb": (("b", "x^3"),),
    "u|a|d": (("u", "x"), ("a", "|x|"), ("d", "x")),
    "u|b|d": (("u", "x"), ("b", "|x|"), ("d", "x")),
    "uud|d|": (("u", "x^2"), ("d", "x|x|")),
}


@dataclass(frozen=True)
class Product:
    """A product on one equation.

    Attributes
    ----------
    generic, equation : str
        Symbol with generic axes, ``A_a|b|``: Y_v|r| and Z_w|q|.
    factors : tuple of (variable, power)
    """

    generic: str
    equation: str
    factors: tuple[Factor, ...]

    @property
    def follows_heading(self) -> bool:
        """Whether it needs a heading that was logged."""
        return any(variable in ("sin", "cos") for variable, _ in self.factors)

    @property
    def planes(self) -> tuple[Plane, ...]:
        """Planes that it stands in."""
        return (HORIZONTAL.name,) if self.follows_heading else PLANES

    @property
    def symbols(self) -> dict[str, tuple[Plane, ...]]:
        """What it is called, and in which planes."""
        found: dict[str, tuple[Plane, ...]] = {}
        for plane in self.planes:
            symbol = symbol_in(plane, self.generic)
            found[symbol] = (*found.get(symbol, ()), plane)
        return found

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
    Product(f"{equation}_{name}", equation, factors)
    for equation, own in (("X", AXIAL), ("A", LATERAL), ("B", LATERAL))
    for name, factors in (own | HEADING).items()
)


def products_of(plane: Plane) -> tuple[Product, ...]:
    """Products that stand in a plane."""
    return tuple(q for q in PRODUCTS if plane in q.planes)
