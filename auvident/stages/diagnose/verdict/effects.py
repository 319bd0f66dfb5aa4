"""Effects of a diagnosis as its artifact has them: disturbances, claimed ones, and the rest."""

from collections.abc import Mapping
from typing import Literal

import numpy as np

from auvident.schema.diagnosis import EffectFound, ParameterValue
from auvident.schema.effect_words import FROM, plain
from auvident.schema.effects import BY_ID, parameter_of
from auvident.stages.diagnose.checks.events import Event
from auvident.stages.diagnose.checks.waves import Wave
from auvident.stages.diagnose.fit.case import counted_from
from auvident.stages.diagnose.select.candidates import Traced, by_sensors
from auvident.stages.diagnose.verdict.evidence import Evidence
from auvident.stages.diagnose.verdict.uncertainty import effect_values, spreads, time_of

# errors on generated trials (`waves`): 0.006 rad/s and 2.6 deg at most
WAVE_STDS = {"omega_radps": 0.02, "direction_deg": 5.0}


def disturbances(evidence: Evidence) -> list[EffectFound]:
    """One-off events and the wave."""
    found = [_event(e) for e in evidence.events]
    if evidence.wave is not None and evidence.wave.found:
        found.append(_wave(evidence.wave, counted_from(evidence.traced.case.records)))
    return found


def _event(e: Event) -> EffectFound:
    return EffectFound(
        id="one_off_event",
        family=BY_ID["one_off_event"].family,
        parameters=_told(
            "one_off_event",
            {"time_s": e.time_s, "duration_s": e.duration_s},
            dict.fromkeys(("time_s", "duration_s"), e.resolution_s),
        ),
        plain=f"a one-off event in {e.maneuver} at {e.time_s:.0f} s (masked)",
        maneuver=e.maneuver,
        time_s=e.time_s,
        duration_s=e.duration_s,
    )


def _wave(wave: Wave, frame: Literal["north", "bow"]) -> EffectFound:
    degrees = float(np.degrees(wave.direction_rad))
    values = {"omega_radps": wave.frequency_radps, "direction_deg": degrees}
    return EffectFound(
        id="wave",
        family=BY_ID["wave"].family,
        parameters=_told("wave", values, WAVE_STDS),
        plain=f"a wave of {wave.frequency_radps:.2f} rad/s towards {degrees:.0f} deg{FROM[frame]}",
        frame=frame,
    )


def _told(
    effect: str, values: Mapping[str, float], stds: Mapping[str, float]
) -> tuple[ParameterValue, ...]:
    """Parameters of a disturbance, in the units of the table of effects."""
    return tuple(
        ParameterValue(
            symbol=symbol,
            value=value,
            std=stds[symbol],
            unit=parameter_of(f"{effect}.{symbol}").unit,
        )
        for symbol, value in values.items()
    )


def accepted(traced: Traced) -> list[EffectFound]:
    """Effects that are claimed, with their sizes and when they began."""
    case, p = traced.case, traced.final.parameters
    if not traced.named:
        return []
    stds = spreads(case, traced.final, traced.without)
    speed = float(np.median(np.concatenate([r.given[:, 0] for r in case.records])))
    rate = float(np.median(np.concatenate([r.inputs[:, 2] for r in case.records])))
    found, frame = [], counted_from(case.records)
    for effect in traced.named:
        values, when = effect_values(case, effect, p, stds), time_of(case, effect, p)
        values = (*values, when) if when else values
        found.append(
            EffectFound(
                id=effect,
                family=BY_ID[effect].family,
                parameters=values,
                plain=plain(effect, values, speed, rate, frame),
                time_s=when.value if when else None,
                frame=frame,
                by_sensors=by_sensors(case, effect, p),
            )
        )
    return found


def nuisances(traced: Traced) -> tuple[EffectFound, ...]:
    """What every model is allowed, and what was taken along, with what they took up."""
    case, effects = traced.case, traced.final.effects
    found: dict[str, list[ParameterValue]] = {}
    for i, name in enumerate(case.names):
        effect = name.partition(".")[0]
        allowed = case.nuisance_std[i] > 0.0 and effect not in effects
        if allowed or effect in traced.unclaimed:
            found.setdefault(effect, []).append(_nuisance(traced, i))
    return tuple(
        EffectFound(id=e, family=BY_ID[e].family, parameters=tuple(values))
        for e, values in found.items()
    )


def _nuisance(traced: Traced, position: int) -> ParameterValue:
    """What a parameter took up, with the width that it is allowed."""
    case, declared = traced.case, parameter_of(traced.case.names[position])
    internal, std = traced.final.parameters[position], case.nuisance_std[position]
    value, shown_std = declared.shown(float(internal), float(std))
    return ParameterValue(symbol=declared.symbol, value=value, std=shown_std, unit=declared.unit)
