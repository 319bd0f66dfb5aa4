"""Findings on how the sensors sampled: late starts, gaps, coarse clocks, losses."""

from collections.abc import Collection, Iterator, Sequence

import numpy as np

from auvident.schema.artifacts import Finding
from auvident.schema.channels import BY_COLUMN, CHANNELS
from auvident.schema.holding import SAMPLED
from auvident.schema.logs import ChannelQuality, SensorQuality

LATE_S = 10.0  # a needed sensor that starts so late or stops so early costs part of the trial
# The start and the stop of sensors that are switched together scatter by seconds; a clock that is
# off by less than SHIFTED_S is found by the checks of clocks, which look 30 s far.
TOGETHER_S, SHIFTED_S, FEWEST_OTHERS = 5.0, 25.0, 2
REPEATED_SHARE = 0.02  # of the rows: stamps are then coarser than the samples
JITTER_SHARE = 0.25  # of the period: stamps are then those of arrival, not of the sample, ...
# ... and of L/U: a vehicle that goes into a turn changes its yaw rate by less than 1 % of that of
# the turn meanwhile; a fast gyro with stamps of whole milliseconds has nothing but a jitter of 3.
JITTER_LENGTHS = 0.01
DROPPED_SHARE = 0.10  # of the rows
TURNED_FLAG = (
    "If the flag marks good samples with 0, as a status or an error does, write its opposite, or "
    "rename it: without a column of that name all rows count."
)
MISSING_SHARE = 0.05  # of the grid
MUCH_SHARE = 0.30  # of a channel's samples that cleaning left out
# Digits of a channel of the motion, of its range: in steps of 1 to 20 the answer to a rudder is
# a stair, and the noise that the filter counts with is none.
COARSE_SHARE = 0.03
MOTION = ("u_mps", "v_mps", "w_mps", "q_radps", "r_radps")
NO_SAMPLES = ("held_copy", "zero_for_empty")  # rows of other sensors
NOT_A_FAULT = ("empty", "repeated_time")  # of the sample that stands there

# What cleaning found wrong with samples of a channel, by reason: code, words, remedy.
FAULTS: dict[str, tuple[str, str, str]] = {
    "saturated": (
        "saturated",
        "are at the end of the sensor's range, which cut the motion off",
        "Widen the range of the sensor; what was beyond is a gap, not data.",
    ),
    "overflow": (
        "overflows",
        "are beyond the sensor's range and came out at its other end",
        "Widen the range of the sensor; what was beyond is a gap, not data.",
    ),
    "stuck": (
        "channel_stuck",
        "repeat the one before where the noise of the channel never does: it was stuck",
        "Look at the sensor and its logger at this time.",
    ),
    "fill_value": (
        "fill_values",
        "hold a number that stands for no value (a zero for lost bottom, an overflow)",
        "Leave the cell empty where there is no value, or log a valid column.",
    ),
    "spike": (
        "spikes",
        "jump off the path of their neighbours faster than the vehicle can",
        "Look for interference, multipath or a loose plug; smaller spikes may be left.",
    ),
}


def sampling_findings(
    trial: str,
    sensors: Sequence[SensorQuality],
    needed: Sequence[str],
    absent: Sequence[str],
    passage_s: float,
    silent: Collection[str] = (),
) -> list[Finding]:
    """Findings of one trial, from the quality of its sensors and the time of a hull length.

    `silent` names inputs that are taken for polled, and seem to be logged only on change.
    """
    own = {BY_COLUMN[column].sensor for column in needed}
    found = [f for s in sensors for c in s.channels for f in _much_left_out(s, c)]
    found += [*_spans([s for s in sensors if s.sensor in own and s.rows_read])]
    found += [*_shifted([s for s in sensors if s.rows_read and s.method != "on_change"])]
    for sensor in sensors:
        is_silent = sensor.sensor in silent
        found += [*_silences(sensor)] if is_silent else []
        found += [*_clock(sensor, np.inf if is_silent else passage_s)]
        found += [*_losses(sensor), *_holds(sensor)]
        for channel in sensor.channels:
            found += [*_channel(sensor, channel, channel.column in needed)]
            found += [*_faults(sensor, channel)]
    found += [*_samples(sensors), *_absent(absent)]
    return [f if f.where else f.model_copy(update={"where": f"trial {trial}"}) for f in found]


def _spans(sensors: Sequence[SensorQuality]) -> Iterator[Finding]:
    """Needed sensors that start late or stop early; a list of commands has no end."""
    if not sensors:
        return
    first = min(s.t_start_s for s in sensors)
    last = max(s.t_end_s for s in sensors)
    for sensor in sensors:
        late = sensor.t_start_s - first
        early = 0.0 if sensor.method == "on_change" else last - sensor.t_end_s
        for code, lost, verb in (("starts_late", late, "starts"), ("stops_early", early, "stops")):
            if lost > LATE_S:
                side = "after the first" if verb == "starts" else "before the last"
                yield Finding(
                    code=f"sensor_{code}",
                    message=f"{sensor.sensor} {verb} {lost:.1f} s {side} sensor; the trial is "
                    "the time that all of them cover",
                    where=sensor.file,
                    value=lost,
                    threshold=LATE_S,
                )


def _shifted(sensors: Sequence[SensorQuality]) -> Iterator[Finding]:
    """A sensor that starts and stops off all others by the same: loggers are switched together."""
    for sensor in sensors:
        others = [s for s in sensors if s is not sensor]
        if len(others) < FEWEST_OTHERS:
            return
        starts, ends = ([getattr(s, e) for s in others] for e in ("t_start_s", "t_end_s"))
        together = max(max(x) - min(x) for x in (starts, ends)) <= TOGETHER_S
        off = sensor.t_start_s - min(starts), sensor.t_end_s - max(ends)
        alike = abs(off[0] - off[1]) <= TOGETHER_S
        if together and alike and min(map(abs, off)) > SHIFTED_S:
            yield _of_clock(sensor, 0.5 * sum(off))


def _of_clock(sensor: SensorQuality, off_s: float) -> Finding:
    side = "after" if off_s > 0.0 else "before"
    return Finding(
        code="sensor_shifted",
        message=f"{sensor.sensor} starts and stops {abs(off_s):.0f} s {side} all other sensors: "
        "its clock is likely off by so much, and every check of it is in doubt",
        where=sensor.file,
        value=off_s,
        threshold=SHIFTED_S,
        remedy=f"If it is: [{sensor.sensor}] time_offset_s = {-off_s:.1f} in a map (--map); the "
        "checks then tell the rest. No other correction is to be trusted before.",
    )


def _clock(sensor: SensorQuality, passage_s: float) -> Iterator[Finding]:
    repeated = max(
        (c.dropped["repeated_time"].count for c in sensor.channels if "repeated_time" in c.dropped),
        default=0,
    )
    if repeated > REPEATED_SHARE * sensor.rows_read:
        yield Finding(
            code="coarse_time",
            message=f"{repeated} of {sensor.rows_read} rows of {sensor.sensor} repeat a time "
            "stamp; one sample per time stamp was used",
            where=sensor.file,
            value=repeated / sensor.rows_read,
            threshold=REPEATED_SHARE,
            remedy="Log the time with more decimals.",
        )
    if not sensor.rate_hz or not sensor.jitter_s or sensor.method == "on_change":
        return
    most = max(JITTER_SHARE / sensor.rate_hz, JITTER_LENGTHS * passage_s)
    if sensor.jitter_s > most:
        yield Finding(
            code="jitter",
            message=f"the time stamps of {sensor.sensor} jitter by {sensor.jitter_s:.3g} s",
            where=sensor.file,
            value=sensor.jitter_s,
            threshold=most,
            remedy="Log the time of sampling rather than of arrival.",
        )


def _losses(sensor: SensorQuality) -> Iterator[Finding]:
    counts = {reason: d.count for reason, d in sensor.dropped.items() if reason not in NO_SAMPLES}
    lost = sum(counts.values())
    if lost > DROPPED_SHARE * sensor.rows_read:
        reasons = ", ".join(f"{count} {reason}" for reason, count in counts.items())
        yield Finding(
            code="many_rows_dropped",
            message=f"{lost} of {sensor.rows_read} rows of {sensor.sensor} dropped: {reasons}",
            where=sensor.file,
            value=lost / sensor.rows_read,
            threshold=DROPPED_SHARE,
            remedy=TURNED_FLAG if counts.get("marked_invalid", 0) > 0.5 * sensor.rows_read else "",
        )


def _holds(sensor: SensorQuality) -> Iterator[Finding]:
    if "held_copy" in sensor.dropped:
        yield Finding(
            code="held_copies",
            message=f"{sensor.sensor} repeats its last sample in "
            f"{sensor.dropped['held_copy'].count} rows; only the rows where it changes were used",
            where=sensor.file,
            value=sensor.rate_hz,
        )
    logged = any(c.source == "logged" for c in sensor.channels)
    if logged and sensor.method in ("on_change", "heartbeat"):
        longest = max((c.longest_gap_s for c in sensor.channels), default=0.0)
        how = "only when it changes" if sensor.method == "on_change" else "on change and regularly"
        yield Finding(
            code="input_logged_on_change",
            message=f"{sensor.sensor} appears to be logged {how}; each value was held until "
            f"the next, for up to {longest:.1f} s",
            where=sensor.file,
            value=longest,
            remedy="If it is polled and these are drop-outs, set on_change = false in a map.",
        )


def _samples(sensors: Sequence[SensorQuality]) -> Iterator[Finding]:
    """Inputs of which the rows are samples, not changes."""
    names = [s.sensor for s in sensors if s.method == SAMPLED]
    if names:
        yield Finding(
            code="input_sampled",
            message=f"rows of {', '.join(names)} were taken for samples, with the input on the "
            "line between two of them: the vehicle answers before them",
            remedy="If each row is the time of a change, set on_change = true in a map.",
        )


def _silences(sensor: SensorQuality) -> Iterator[Finding]:
    longest = max((c.longest_gap_s for c in sensor.channels), default=0.0)
    gaps = sum(c.gaps for c in sensor.channels)
    left = f", and {gaps} silences count as gaps" if gaps else ""
    yield Finding(
        code="input_seems_on_change",
        message=f"{sensor.sensor} may be logged only when it changes: hardly a row repeats the one "
        f"before, and it is silent for up to {longest:.1f} s at a time; it was taken for polled"
        f"{left}",
        where=sensor.file,
        value=longest,
        remedy=f"If each value was held until the next, set on_change = true in [{sensor.sensor}] "
        "of a map (--map).",
    )


def _channel(sensor: SensorQuality, channel: ChannelQuality, needed: bool) -> Iterator[Finding]:
    if needed and channel.missing_share > MISSING_SHARE:
        yield Finding(
            code="much_missing",
            message=f"{channel.column} is unknown for {100 * channel.missing_share:.0f} % of the "
            f"trial: {channel.gaps} gaps, the longest {channel.longest_gap_s:.1f} s",
            where=sensor.file,
            value=channel.missing_share,
            threshold=MISSING_SHARE,
        )
    constant = channel.minimum == channel.maximum and channel.samples > 1
    if constant and BY_COLUMN[channel.column].kind == "measured":
        yield Finding(
            code="constant_channel",
            message=f"{channel.column} never changes; the sensor may be stuck",
            where=sensor.file,
            value=channel.minimum,
        )
    span = channel.maximum - channel.minimum
    coarse = channel.resolution is not None and channel.resolution > COARSE_SHARE * span
    if coarse and not constant and channel.column in MOTION:
        yield _coarse(sensor, channel, span)
    if constant and channel.column == "rudder_rad":
        yield Finding(
            code="rudder_never_moves",
            message="the rudder never moves, so no turn can be identified",
            where=sensor.file,
            value=channel.minimum,
        )


def _coarse(sensor: SensorQuality, channel: ChannelQuality, span: float) -> Finding:
    assert channel.resolution is not None
    return Finding(
        code="coarse_channel",
        message=f"{channel.log_column} comes in steps of {channel.resolution:.3g} {channel.unit}, "
        f"{100 * channel.resolution / span:.0f} % of its range; what moves less is lost",
        where=sensor.file,
        value=channel.resolution / span,
        threshold=COARSE_SHARE,
        remedy="Log it with more digits, or set the sensor to a narrower range.",
    )


def _much_left_out(sensor: SensorQuality, channel: ChannelQuality) -> Iterator[Finding]:
    """A channel of which cleaning left little, with the counts by reason."""
    counts = {why: d.count for why, d in channel.dropped.items() if why not in NOT_A_FAULT}
    lost = sum(counts.values())
    total = channel.samples + lost
    if lost > MUCH_SHARE * total:
        reasons = ", ".join(f"{count} {reason}" for reason, count in counts.items())
        yield Finding(
            code="much_left_out",
            message=f"{100 * lost / total:.0f} % of the samples of {channel.log_column} are not "
            f"measurements and were left out: {reasons}",
            where=sensor.file,
            value=lost / total,
            threshold=MUCH_SHARE,
            remedy="Check this channel before you rely on any result that depends on it.",
        )


def _faults(sensor: SensorQuality, channel: ChannelQuality) -> Iterator[Finding]:
    """What cleaning found wrong with samples of a channel: how many, and where first."""
    for reason, (code, words, remedy) in FAULTS.items():
        dropped = channel.dropped.get(reason)
        if dropped is None:
            continue
        share = dropped.count / (channel.samples + dropped.count)
        yield Finding(
            code=code,
            message=f"{dropped.count} samples of {channel.log_column} ({100 * share:.2g} %, the "
            f"first at {dropped.first_times_s[0]:.2f} s, row {dropped.first_rows[0]}) {words}",
            where=sensor.file,
            value=share,
            remedy=remedy,
        )


def _absent(absent: Sequence[str]) -> Iterator[Finding]:
    order = [c.column for c in CHANNELS]
    if absent:
        names = ", ".join(sorted(absent, key=order.index))
        yield Finding(
            code="channels_absent",
            message=f"not in the log: {names}",
            value=float(np.size(absent)),
        )
