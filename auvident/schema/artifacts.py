"""What stands in the run directory: one class per JSON artifact.

`auvident schema NAME` prints the JSON schema of each. Values are dimensional SI; ``prime`` is
the SNAME non-dimensional value. Version numbers rise when a key is renamed or dropped.
"""

from collections import Counter
from typing import Any, Literal, Self

from pydantic import Field, model_validator

from auvident.schema.base import Artifact
from auvident.schema.effects import BY_ID
from auvident.schema.planes import ManeuverKind, Plane

Role = Literal["identify", "validate"]
Origin = Literal["identified", "ase", "given", "kinematic"]
Verdict = Literal["none_found", "effect_found", "ambiguous", "partly_explained", "unexplained"]
RAN_AWAY = "prediction-ran-away"  # code of a finding: a gate cannot be met with one
# Codes of findings on the errors of a model, and on a model: those on a refined one take the place
# of those on the one before.
ON_ERRORS = ("not-predicted", "no-better", "worse-than-prior")
ESTIMATE_CONTRADICTED = "estimate-contradicted"  # by so much that another vehicle is likely
ON_A_MODEL = (*ON_ERRORS, "rests-on-prior", "window-ran-away", "drawn-models-run-away")
PRIOR_WORDS = {"ASE": "the estimate from geometry (ASE)", "prior": "the given coefficients (prior)"}


class Finding(Artifact):
    """Something the user should know: a code to grep for, evidence, and what to do."""

    code: str
    message: str
    where: str = ""
    value: float | None = None
    threshold: float | None = None
    remedy: str = ""


class Maneuver(Artifact):
    """A piece of a trial that the identification or the validation uses.

    ``plane`` is the one whose fin, rate and angle its features are of; ``planes`` those in which
    it identifies and validates: a run with thrust steps does in both. A list of an
    earlier version has them among its features, one written by hand need not have them.
    ``reason`` says why it is held out; empty where it identifies.
    """

    id: str
    trial: str
    kind: ManeuverKind
    t_start_s: float
    t_end_s: float
    role: Role
    plane: Plane
    planes: tuple[Plane, ...]
    reason: str = ""
    features: dict[str, Any] = {}

    @model_validator(mode="before")
    @classmethod
    def _with_planes(cls, data: dict[str, Any]) -> dict[str, Any]:
        told = data.get("features") or {}
        plane = data.get("plane") or told.get("plane", "horizontal")
        planes = data.get("planes") or told.get("planes", (plane,))
        return {**data, "plane": plane, "planes": planes}

    def shows(self, plane: Plane) -> bool:
        """Whether it identifies and validates in a plane."""
        return plane in self.planes


class Rejected(Artifact):
    """A piece that was looked at and is no maneuver, with the reason."""

    trial: str
    t_start_s: float
    t_end_s: float
    reason: str
    value: float | None = None
    threshold: float | None = None


class Maneuvers(Artifact):
    """``segment/maneuvers.json``."""

    schema_: str = Field(default="auvident/maneuvers/1", alias="schema")
    maneuvers: tuple[Maneuver, ...]
    rejected: tuple[Rejected, ...] = ()
    findings: tuple[Finding, ...] = ()


class AseCoefficient(Artifact):
    """One coefficient with its standard deviation and what each part contributes.

    ``rigid_body`` is what the mass of the vehicle adds to the same product in its equation of
    motion (-m in ``Y_ur``, m in the mass matrix beside ``-Y_vdot``); it is no part of the value.
    """

    symbol: str
    plane: Plane | Literal["both"]
    value: float
    std: float
    unit: str
    prime: float
    parts: dict[str, float] = {}
    rigid_body: float = 0.0
    origin: Literal["ase", "given"] = "ase"


class AseConstant(Artifact):
    """One constant as the vehicle file has it; ``source`` says what its value rests on."""

    symbol: str
    plane: Plane
    value: float
    std: float
    unit: str
    source: str = ""


class AseRoll(Artifact):
    """One term of roll, which no plane of motion has, with what each part contributes."""

    symbol: str
    equation: str
    regressor: str
    value: float
    std: float
    unit: str
    parts: dict[str, float] = {}


class AseResult(Artifact):
    """``ase/coefficients.json``.

    ``constants`` are those that are estimated beside the coefficients; they have no prime value.
    ``roll`` has what a model of six degrees of freedom needs beside the two planes.
    ``accuracy_effects[formula][symbol]`` is the one-sigma effect of a formula's accuracy on a
    coefficient; the formulas are independent of each other.
    """

    schema_: str = Field(default="auvident/ase/1", alias="schema")
    vehicle: str
    applies: bool = True
    speed_mps: float
    length_m: float
    density_kgpm3: float
    coefficients: tuple[AseCoefficient, ...]
    constants: tuple[AseConstant, ...] = ()
    roll: tuple[AseRoll, ...] = ()
    geometry: dict[str, float] = {}
    facts: dict[str, Any] = {}
    accuracy_effects: dict[str, dict[str, float]] = {}
    findings: tuple[Finding, ...] = ()

    @property
    def estimates(self) -> tuple[AseCoefficient | AseConstant, ...]:
        """Coefficients, then constants."""
        return (*self.coefficients, *self.constants)

    def by_symbol(self) -> dict[str, AseCoefficient]:
        """Coefficients by their symbol."""
        return {c.symbol: c for c in self.coefficients}


class ModelConstant(Artifact):
    """One constant of an identified model, the prior that of the vehicle file.

    ``std`` is the larger of the filter's own standard deviation and that from the scatter
    between maneuvers (jackknife), at most the prior's; both stand beside it. ``shared_with``
    names the plane whose data went into it as well.
    """

    symbol: str
    value: float
    std: float
    unit: str
    prior: float
    prior_std: float
    origin: Origin
    data_share: float
    std_filter: float | None = None
    std_jackknife: float | None = None
    shared_with: Plane | None = None


class ModelCoefficient(ModelConstant):
    """One coefficient of an identified model."""

    prime: float


class Combination(Artifact):
    """A direction in coefficient space that the data cannot see."""

    symbols: tuple[str, ...]
    weights: tuple[float, ...]
    information: float
    structural: bool = False
    meaning: str = ""


class RigidBody(Artifact):
    """Mass, its moment arms and inertia, weight, buoyancy and fins, as the vehicle file has them.

    ``fin_x_m`` is the station of the fins that steer in the plane.
    """

    mass_kg: float
    x_g_m: float
    z_g_m: float
    inertia_kgm2: float
    weight_n: float
    buoyancy_n: float
    trim_moment_nm: float = 0.0  # x_G W - x_B B; a vehicle is ballasted to lie level
    fin_x_m: float = 0.0

    def constants(self) -> dict[str, float]:
        """Value of each constant that the data may change, by symbol."""
        return {
            "W-B": self.weight_n - self.buoyancy_n,
            "x_GW": self.trim_moment_nm,
            "z_GW": self.z_g_m * self.weight_n,
        }


class Sensing(Artifact):
    """Where the sensors sit and how accurate they proved to be."""

    dvl_x_m: float
    dvl_y_m: float
    dvl_z_m: float
    dvl_mounting_yaw_rad: float
    noise_std: dict[str, float]


class NisTest(Artifact):
    """Normalised innovation squared of a channel; see `auvident.estimation.innovations`.

    ``ks`` is the Kolmogorov-Smirnov distance of the innovations from the standard normal
    distribution, ``ks_p`` its probability with so many independent ones (``effective_samples``).
    """

    mean: float
    correlation: float
    corrected: float
    low: float
    high: float
    effective_samples: float | None = None
    ks: float | None = None
    ks_p: float | None = None


class NoiseClaim(Artifact):
    """Squared scatter of the maneuvers over that which the noise of the fit lets them have.

    1 where the standard deviations are right; ``freedom`` is the expected sum of squares and
    ``low``, ``high`` the 95 % band of the ratio.
    """

    ratio: float
    freedom: float
    low: float
    high: float


class AgainstPrior(Artifact):
    """What the data alone say of a coefficient, the others held by data and prior, and its prior.

    ``away`` is their difference in standard deviations of both together.
    """

    symbol: str
    prior: float
    prior_std: float
    data: float
    data_std: float
    away: float


class PriorAgainstData(Artifact):
    """The prior against the data, coefficient by coefficient and along all that the data see.

    ``p`` is the probability of a larger ``chi_square`` in so many ``directions`` if the prior is
    as uncertain as it says.
    """

    coefficients: tuple[AgainstPrior, ...]
    chi_square: float
    directions: int
    p: float


class FittedNoise(Artifact):
    """Noise of a channel in a fit: of the sensor, and a disturbance with its correlation time."""

    white_std: float
    slow_std: float
    slow_time_s: float


class StageRecord(Artifact):
    """One pass of the plan: what was free, what it used and how well it explained the data.

    `noise_std` is what an independent reading counts with. In a filter that times the root of a
    step, over `observer_time_s`, is the process noise per square root of a second: the filter
    follows its readings within this time. `fitted_noise` is the noise of an output-error stage, of
    which `nis` tests the innovations of each maneuver with the noise that the others have.
    """

    stage: str
    cycle: int
    system: str
    free: tuple[str, ...]
    maneuvers: tuple[str, ...]
    samples: int
    log_likelihood: float
    noise_std: dict[str, float] = {}
    nis_mean: dict[str, float] = {}
    nis: dict[str, NisTest] = {}
    observer_time_s: float | None = None
    fitted_noise: dict[str, FittedNoise] = {}


class LeftOutError(Artifact):
    """Error of one channel of a maneuver that was left out."""

    rmse: float
    samples: int


class LeftOutManeuver(Artifact):
    """An identifying maneuver, predicted with coefficients identified from the others.

    ``channels`` is empty where that prediction diverges.
    """

    id: str
    channels: dict[str, LeftOutError]


class ModelError(Artifact):
    """What makes the band of a channel, beside the covariance and the noise of the sensor.

    The model error ``std`` grows with the power ``growth`` of one second and the time since the
    start; ``factor`` goes onto the standard deviation that is the sum of all three.
    """

    std: float
    growth: float
    factor: float


class LeftOutSummary(Artifact):
    """Maneuvers left out in turn: ``spread`` measured, ``push`` to a hull (`engines.falling`)."""

    maneuvers: tuple[LeftOutManeuver, ...]
    spread: dict[str, float]
    model_error: dict[str, ModelError]
    push: dict[str, float] = {}


class ProfileInterval(Artifact):
    """95 % interval of a parameter by its profile, beside the Gaussian one.

    ``root`` is the signed root of twice the fall of the log-posterior at ``values``, the other
    parameters fitted again; of a Gaussian it is a straight line.
    """

    symbol: str
    low: float
    high: float
    gaussian_low: float
    gaussian_high: float
    values: tuple[float, ...]
    root: tuple[float, ...]


class ConstraintState(Artifact):
    """A constraint of physics on a model, see ``auvident.physics.consistency``.

    ``value`` is without dimension, zero at the edge; ``cost_nats`` is what the log posterior of the
    last stage would gain without the constraint, to second order.
    """

    id: str
    value: float
    active: bool
    cost_nats: float


class IdentifiedModel(Artifact):
    """``identify/model.json`` (and ``refine/model.json``).

    ``rigid_body`` is that of the vehicle file; where ``constants`` names what it holds as well, the
    equations take that. ``flown`` is what the maneuvers behind it reach, see
    `auvident.engines.flown.reached`; empty in a model of an earlier version.
    """

    schema_: str = Field(default="auvident/model/1", alias="schema")
    vehicle: str
    plane: Plane
    filter: Literal["ekf", "ukf"]
    engine: Literal["compiled", "filterpy"] = "compiled"
    plan: str = ""
    length_m: float
    density_kgpm3: float
    rigid_body: RigidBody
    sensing: Sensing
    flown: dict[str, float] = {}
    coefficients: tuple[ModelCoefficient, ...]
    constants: tuple[ModelConstant, ...] = ()
    effects: tuple[dict[str, Any], ...] = ()
    covariance: dict[str, Any] = {}
    correlations: dict[str, dict[str, float]] = {}
    unidentifiable: tuple[Combination, ...] = ()
    constraints: tuple[ConstraintState, ...] = ()
    left_out: LeftOutSummary | None = None
    prior_against_data: PriorAgainstData | None = None
    noise_claim: NoiseClaim | None = None
    profile: tuple[ProfileInterval, ...] = ()
    stages: tuple[StageRecord, ...] = ()
    findings: tuple[Finding, ...] = ()

    @model_validator(mode="after")
    def _effects_act_in_its_plane(self) -> Self:
        """Those of an earlier version may not: its elevators had the effects of a rudder."""
        for name in (str(e.get("id")) for e in self.effects):
            if name in BY_ID and self.plane not in BY_ID[name].planes:
                twin = f" (it is {BY_ID[name].twin!r} now)" if BY_ID[name].twin else ""
                raise ValueError(
                    f"the effect {name!r} does not act in the {self.plane} plane{twin}: the model "
                    "is of an earlier version; identify it again"
                )
        return self

    @model_validator(mode="after")
    def _each_stands_once(self) -> Self:
        """A file that was changed by hand may have two values of one coefficient."""
        named = [*(e.symbol for e in self.estimates), *(str(e.get("id")) for e in self.effects)]
        twice = next((name for name, count in Counter(named).items() if count > 1), None)
        if twice is not None:
            raise ValueError(f"{twice!r} stands in it twice; identify the model again")
        return self

    def values(self) -> dict[str, float]:
        """Value of each coefficient and constant by symbol."""
        return {c.symbol: c.value for c in self.estimates}

    def priors(self) -> dict[str, float]:
        """Prior of each coefficient and constant by symbol."""
        return {c.symbol: c.prior for c in self.estimates}

    @property
    def estimates(self) -> tuple[ModelConstant, ...]:
        """Coefficients, then constants; a model of an earlier version has none of the latter."""
        return (*self.coefficients, *self.constants)


class TrialCandidate(Artifact):
    """A maneuver that could be added to a trial, and what it would add."""

    name: str
    what: str
    duration_s: float
    gain_nats: float
    shrinks: dict[str, float] = {}


class TrialPlan(Artifact):
    """What `auvident plan-trial` prints: candidate maneuvers, best first."""

    schema_: str = Field(default="auvident/trial-plan/1", alias="schema")
    vehicle: str
    plane: Plane
    candidates: tuple[TrialCandidate, ...]


class ChannelMetrics(Artifact):
    """How well one channel of one maneuver (or of all of a role) is predicted."""

    rmse: float
    nrmse: float
    r2: float
    theil: float
    unit: str
    samples: int


class ManeuverMetrics(Artifact):
    """Prediction of one maneuver, with its figures measured and simulated."""

    id: str
    trial: str
    kind: ManeuverKind
    role: Role
    duration_s: float
    channels: dict[str, ChannelMetrics]
    turn: dict[str, dict[str, float]] | None = None
    zigzag: dict[str, dict[str, float]] | None = None


class Autocorrelation(Artifact):
    """Autocorrelation of whitened innovations: the largest, its 95 % band, and all lags.

    ``outside`` is the share of the lags outside their band, ``p`` that of Ljung and Box.
    ``values`` are those at the lags ``lags_s``; empty in a file of an earlier version.
    """

    largest: float
    lag_s: float
    band: float
    outside: float
    p: float
    lags_s: tuple[float, ...] = ()
    values: tuple[float, ...] = ()


class InputCorrelation(Artifact):
    """Largest correlation of a residual with an input ``lag_s`` before, and its 95 % band."""

    largest: float
    lag_s: float
    band: float


class Theil(Artifact):
    """Inequality coefficient of Theil, and the shares of the squared error, which add up to 1.

    Bias is that of the means, variance that of the standard deviations, covariance the rest.
    """

    coefficient: float
    bias: float
    variance: float
    covariance: float


class ResidualTests(Artifact):
    """Residual analysis of a channel over the maneuvers of a role.

    The noise is that of the residuals of the identifying maneuvers, each tested with that of the
    others. What the fit does not compare (a heading, which is a sum) has only ``theil``.
    """

    theil: Theil | None = None
    noise: FittedNoise | None = None
    nis: NisTest | None = None
    autocorrelation: Autocorrelation | None = None
    inputs: dict[str, InputCorrelation] = {}


class Coverage(Artifact):
    """Share of the held-out samples of a channel within the band, and its mean width."""

    nominal: float
    covered: float
    width: float
    unit: str
    samples: int


class CrossValidation(Artifact):
    """Error of a channel with each identifying maneuver left out in turn; se over maneuvers."""

    rmse: float
    nrmse: float
    se: float
    unit: str


class Extrapolation(Artifact):
    """What a motion reaches of a quantity, and the maneuvers that identify do at the most."""

    reaches: float
    identified: float
    unit: str


class Metrics(Artifact):
    """``validate/metrics.json``; ``ase`` holds the same for the prior alone, without band.

    The prior is the estimate from geometry (ASE) where ``estimated``, else given coefficients.
    ``horizons`` has the errors of the held-out maneuvers predicted in windows of so many seconds,
    each from the readings at its start. ``extrapolation`` says by held-out maneuver and quantity
    where it leaves the range of those that identify.
    """

    schema_: str = Field(default="auvident/metrics/1", alias="schema")
    maneuvers: tuple[ManeuverMetrics, ...]
    summary: dict[str, dict[str, ChannelMetrics]]
    coverage: dict[str, Coverage] = {}
    cross_validation: dict[str, CrossValidation] = {}
    residuals: dict[str, dict[str, ResidualTests]] = {}
    horizons: dict[str, dict[str, ChannelMetrics]] = {}
    extrapolation: dict[str, dict[str, Extrapolation]] = {}
    ase: "Metrics | None" = None
    estimated: bool = True
    findings: tuple[Finding, ...] = ()
