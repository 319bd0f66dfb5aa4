"""The model of six degrees of freedom that is made of those of the planes."""

from typing import Any

import numpy as np
from pydantic import Field

from auvident.schema.artifacts import Finding, ModelError, Sensing
from auvident.schema.base import Artifact
from auvident.schema.planes import Plane

COMBINED = "auvident/combined/1"


class CombinedEntry(Artifact):
    """A coefficient or constant, and where it comes from.

    ``origin`` is ``identified, horizontal``, ``identified, vertical``, ``identified, both``,
    ``geometry`` or ``vehicle file``. An estimate from geometry keeps the ``sign`` that physics has
    for it: a wide standard deviation about a small value means that only its size is unknown.
    """

    symbol: str
    value: float
    std: float
    unit: str
    origin: str
    prime: float | None = None
    data_share: float = 0.0
    sign: int = 0


class CovarianceBlock(Artifact):
    """Covariance of symbols that are known together; blocks are independent of each other."""

    origin: str
    symbols: tuple[str, ...]
    matrix: tuple[tuple[float, ...], ...]


class CombinedSource(Artifact):
    """A model that went in."""

    plane: Plane
    vehicle: str
    filter: str
    maneuvers: tuple[str, ...] = ()
    file: str = ""


class ChannelBand(ModelError):
    """What makes the band of a channel beside the coefficients, from the model of a ``plane``.

    ``noise_std`` is that of its sensor; the others come from maneuvers left out in turn.
    """

    plane: Plane
    noise_std: float


class CombinedModel(Artifact):
    """A model of six degrees of freedom: ``combine/model.json``, or what `combine` writes.

    ``constants`` are mass, inertia and what weight and buoyancy do: ``W-B`` [N], trim moment
    ``x_GW`` = x_G W - x_B B and righting moment ``z_GW`` [N m]. ``effects`` are those of the
    models, by plane, ``parameters`` the value of each of their parameters in the equations;
    ``fin_x_m`` the station of rudder and elevator, ``flown`` the range of each model.
    ``band`` is by channel: of those that it lacks (nothing was left out in turn, or the file is of
    an earlier version) no more than the scatter of the coefficients is known. ``pushes`` are those
    to a hull that hardly keeps its course, by plane and state (`auvident.engines.falling`).
    """

    schema_: str = Field(default=COMBINED, alias="schema")
    vehicle: str
    length_m: float
    density_kgpm3: float
    x_g_m: float
    fin_x_m: dict[str, float] = {}
    coefficients: tuple[CombinedEntry, ...]
    constants: tuple[CombinedEntry, ...]
    covariance: tuple[CovarianceBlock, ...] = ()
    effects: dict[Plane, tuple[dict[str, Any], ...]] = {}
    parameters: dict[str, float] = {}
    sensing: dict[Plane, Sensing] = {}
    flown: dict[Plane, dict[str, float]] = {}
    band: dict[str, ChannelBand] = {}
    pushes: dict[Plane, dict[str, float]] = {}
    models: tuple[CombinedSource, ...] = ()
    findings: tuple[Finding, ...] = ()

    @property
    def entries(self) -> tuple[CombinedEntry, ...]:
        """Coefficients, then constants."""
        return (*self.coefficients, *self.constants)

    def effect_ids(self, plane: Plane) -> tuple[str, ...]:
        """Effects that the model of a plane carries."""
        return tuple(str(effect["id"]) for effect in self.effects.get(plane, ()))

    def values(self, moved: dict[str, float] | None = None) -> dict[str, float]:
        """Value of every parameter of the equations by its name there.

        Parameters
        ----------
        moved : mapping, optional
            What is added to coefficients, constants and parameters of effects.
        """
        values = {entry.symbol: entry.value for entry in self.entries} | self.parameters
        for name, by in (moved or {}).items():
            values[name] += by
        stations = {f"x_{fin}": x for fin, x in self.fin_x_m.items()}
        return values | stations | {"m x_G": values["m"] * self.x_g_m}

    def draws(self, count: int, rng: np.random.Generator) -> list[dict[str, float]]:
        """Deviations of the entries, drawn from the covariance."""
        drawn: list[dict[str, float]] = [{} for _ in range(count)]
        for block in self.covariance:
            matrix = np.array(block.matrix)
            # In units of each one's own deviation: what rounding adds is small beside each of them.
            spread = np.sqrt(np.maximum(np.diag(matrix), np.finfo(float).tiny))
            # eigenvalues may be rounded below zero; the method takes them as zero
            rows = rng.multivariate_normal(
                np.zeros(len(spread)),
                matrix / np.outer(spread, spread),
                size=count,
                method="eigh",
                check_valid="ignore",
            )
            for moved, row in zip(drawn, spread * rows, strict=True):
                moved |= dict(zip(block.symbols, row.tolist(), strict=True))
        return [self._with_signs(moved) for moved in drawn]

    def _with_signs(self, moved: dict[str, float]) -> dict[str, float]:
        """Deviations of estimates from geometry that do not turn their sign."""
        for e in self.entries:
            if e.symbol in moved and e.origin == "geometry" and e.sign * e.value > 0.0:
                moved[e.symbol] = e.sign * abs(e.value + moved[e.symbol]) - e.value
        return moved
