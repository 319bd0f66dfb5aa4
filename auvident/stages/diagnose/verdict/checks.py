"""What was looked at besides the candidates: sensors, the wave, free forces, the residual."""

from typing import Any

from auvident.schema.effects import parameter_of
from auvident.stages.diagnose.checks.kinematics import SensorCheck
from auvident.stages.diagnose.checks.waves import Wave
from auvident.stages.diagnose.fit.case import Case
from auvident.stages.diagnose.fit.fits import Fitted, check_cost
from auvident.stages.diagnose.score.free_forces import FreeForce
from auvident.stages.diagnose.verdict.evidence import Evidence


def checks(evidence: Evidence) -> dict[str, Any]:
    """Rows of the artifact, by what was looked at."""
    case, wave = evidence.traced.case, evidence.wave
    both = {"before": evidence.traced.baseline, "after": evidence.traced.final}
    return {
        **{check.what: _sensors(check) for check in case.checks},
        "sensor_distance": {when: check_cost(case, f.parameters) for when, f in both.items()},
        **({"wave": _wave(wave)} if wave is not None else {}),
        "free_forces": [correlate(case, force) for force in evidence.free],
        "rms": {when: _rms(case, fitted) for when, fitted in both.items()},
    }


def _sensors(check: SensorCheck) -> dict[str, dict[str, float]]:
    """Parameters of the sensors that two logs tell, as shown."""
    found = {}
    for name in check.names:
        declared, (value, std) = parameter_of(name), check.alone(name)
        found[name] = {"value": declared.shown(value)[0], "std": declared.shown(0.0, std)[1]}
    return found


def _wave(wave: Wave) -> dict[str, float]:
    return {
        "power_ratio": wave.power_ratio,
        "threshold": wave.threshold,
        "omega_radps": wave.frequency_radps,
    }


def _rms(case: Case, fitted: Fitted) -> dict[str, float]:
    return dict(zip(case.channels, fitted.rms.tolist(), strict=True))


def correlate(case: Case, force: FreeForce) -> dict[str, Any]:
    """What a free force follows, and what it explains."""
    return {
        "axis": force.axis,
        "regressor": force.regressor,
        "gain": force.gain,
        "helps": force.helps,
        "rms": force.size,
        "rms_fall": {n: float(f) for n, f in zip(case.channels, force.falls, strict=True)},
    }
