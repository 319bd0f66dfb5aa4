"""Effects in words, in plain units."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from auvident.schema.confirmed import holds_nothing
from auvident.schema.diagnosis import Bound, ParameterValue
from auvident.schema.effects import BY_ID, Effect, parameter_of

# where an id with spaces for its bars is not what an engineer says
NAMES = {
    "current_drift": "change of the current",
    "one_off_event": "one-off push",
    "rudder_rate_limit": "servo speed limit",
    "rudder_lag": "servo lag",
    "elevator_rate_limit": "elevator speed limit",
    **{
        f"{fin}_{kind}": f"{words} of the {fin}"
        for fin in ("rudder", "elevator")
        for kind, words in (
            ("backlash", "backlash"),
            ("deadband", "dead band"),
            ("asymmetry", "asymmetry"),
        )
    },
    "propeller_race": "propeller race on the fin",
    "thrust_sag": "decline of thrust",
    "thrust_step": "step of thrust",
    "dvl_delay": "DVL delay",
    "dvl_misalignment": "DVL misalignment",
    "dvl_scale": "DVL scale error",
    "dvl_lever_arm": "error of the DVL lever arm",
    "dvl_height": "height of the DVL",
    "dvl_pitch": "DVL misalignment in pitch",
    "gyro_scale": "gyro scale error",
    "q_bias": "pitch gyro bias",
    "q_scale": "pitch gyro scale error",
    "pitch_scale": "pitch scale error",
    "depth_lag": "lag of the depth sensor",
    "depth_scale": "depth scale error",
    "weight_change": "change of weight",
    "buoyancy_gradient": "change of buoyancy with depth",
    "roll_coupling": "force due to roll",
    "weight_excess": "weight minus buoyancy",
}


BOUNDS: dict[Bound, str] = {"at least": "at least ", "at most": "no more than "}

# behind a direction, what it counts from
FROM = {"north": "", "bow": " from the bow at the start of the log"}
# the axes of a horizontal velocity of the water, by what directions count from
AXES = {"north": {}, "bow": {"north": "ahead", "east": "to starboard"}}
DRIFT = "mps_per_1000_s"  # end of the symbols of rates of the current


class Told(float):
    """A value that says, wherever it is written, that it is known to one side only.

    Written as ``grows|falls`` it is the word for its sign, as ``abs`` and a format its size.
    """

    def __new__(cls, value: float, bound: Bound | None = None) -> "Told":
        """A value, with the side that it is known to."""
        made = super().__new__(cls, value)
        made.bound = bound
        return made

    bound: Bound | None

    def __format__(self, spec: str) -> str:
        if "|" in spec:
            return spec.split("|")[self < 0.0]
        side = BOUNDS[self.bound] if self.bound else ""
        if not spec.startswith("abs"):
            return side + format(float(self), spec)
        if self < 0.0 and self.bound:  # no more than -1 is at least 1 the other way
            side = next(said for bound, said in BOUNDS.items() if bound != self.bound)
        return side + format(abs(float(self)), spec.removeprefix("abs"))

    def times(self, factor: float) -> "Told":
        """The value in another unit, by a factor above zero."""
        return Told(self * factor, self.bound)


def plain(
    effect: str,
    parameters: Sequence[ParameterValue],
    speed: float,
    rate: float,
    frame: str = "north",
) -> str:
    """An effect in words, without sizes that cannot be told from none where others can.

    Parameters
    ----------
    effect : str
    parameters : sequence of ParameterValue
    speed, rate : float
        Speed [m/s] and propeller rate [rev/s] of the cruise at which forces are told.
    frame : str
        What directions count from, see `EffectFound`.
    """
    values = {p.symbol: Told(p.value, p.bound) for p in parameters}
    surely = [p for p in parameters if not holds_nothing(effect, p)] or parameters
    words = _words(BY_ID[effect], {p.symbol: values[p.symbol] for p in surely})
    words = words or _words(BY_ID[effect], values)
    if BY_ID[effect].instant is not None:
        return _in(words, values) + _when(parameters)
    if effect == "current":
        return f"a current of {_set(values['north_mps'], values['east_mps'], 'm/s')}{FROM[frame]}"
    if effect == "current_drift":
        early, late = (
            _set(values[f"north_{half}_{DRIFT}"], values[f"east_{half}_{DRIFT}"], "m/s in 1000 s")
            for half in ("early", "late")
        )
        return f"a current that changes by {early} in the first half of the trial, {late} after"
    if words:
        return _in(words, values)
    if effect == "hull_asymmetry":
        y, n = (value.times(speed**2) for value in values.values())
        return f"a hull asymmetry with {y:.2f} N and {n:.2f} N m at {speed:.1f} m/s"
    if effect == "propeller_side_force":
        y, n = (values[symbol].times(rate**2) for symbol in ("Y_nn", "N_nn"))
        return f"a propeller side force of {y:.2f} N and {n:.2f} N m at {60 * rate:.0f} rpm"
    listed = ", ".join(f"{p.symbol} {values[p.symbol]:.3g} {p.unit}" for p in surely)
    return f"{words_of(effect)} ({listed})"


def _words(effect: Effect, values: Mapping[str, Told]) -> str:
    """Words of an effect whose fields all have a value."""
    ways = (effect.words,) if isinstance(effect.words, str) else effect.words
    return next((words for words in ways if all(p in values for p in _fields(words))), "")


def _in(words: str, values: Mapping[str, Told]) -> str:
    """The words of an effect with its values; a bound stands before its sign and is no guess."""
    text = words.format(**values)
    for said in BOUNDS.values():
        text = text.replace(f"±{said}", f"{said}±").replace(f"about {said}", said)
    return text


def _set(north: Told, east: Told, unit: str) -> str:
    """Size and direction of a velocity of the water, or of its rate."""
    towards = math.degrees(math.atan2(east, north)) % 360.0
    size = Told(math.hypot(north, east), "at least" if north.bound or east.bound else None)
    return f"{size:.2f} {unit} towards {towards:.0f} deg"


def _when(parameters: Sequence[ParameterValue]) -> str:
    """When something happened, as far as it is known."""
    for p in parameters:
        if p.symbol == "time_s" and p.low is not None and p.high is not None:
            return f" between {p.low:.0f} s and {p.high:.0f} s"
    return " at one time"


def _fields(text: str) -> list[str]:
    return [part.split(":")[0].split("}")[0] for part in text.split("{")[1:]]


def with_std(value: float, std: float) -> str:
    """A value and its standard deviation, of which two digits are shown."""
    if not 0.0 < std < math.inf:
        return f"{value:.3g}"
    decimals = max(1 - math.floor(math.log10(std)), 0)
    return f"{value:.{decimals}f} ± {std:.{decimals}f}"


def nuisance_parameters(effects: Sequence[Mapping[str, Any]]) -> str:
    """What a model adjusts along with its coefficients, from the rows of its artifact.

    A limit whose inverse may as well be zero is not known by the size that is shown.
    """
    needed, idle, unknown = [], [], []
    for e in (e for e in effects if e.get("nuisance")):
        for p in e["parameters"]:
            internal = f"{e['id']}.{p['symbol']}"
            name = words_of(e["id"], p["symbol"])
            declared = parameter_of(internal)
            if declared.is_nothing(e["internal"][internal]):
                idle.append(name)
            elif declared.form != "plain" and p["std"] >= p["value"]:
                unknown.append(name)
            else:
                needed.append(f"{name} {with_std(p['value'], p['std'])} {p['unit']}")
    found = f"Adjusted along with the coefficients: {', '.join(needed)}." if needed else ""
    spare = f"{_upper(', '.join(idle))}: not needed." if idle else ""
    open_ = f"{_upper(', '.join(unknown))}: not determined by these data." if unknown else ""
    return " ".join(text for text in (found, open_, spare) if text)


def _upper(text: str) -> str:
    """A text with its first letter large, the others as they are."""
    return f"{text[:1].upper()}{text[1:]}"


def words_of(effect: str, symbol: str = "") -> str:
    """An effect without its sizes; with the symbol of a parameter where it has several."""
    words = NAMES.get(effect, effect.replace("_", " "))
    return f"{words} {symbol}" if symbol and len(BY_ID[effect].parameters) > 1 else words
