"""Milliseconds that are read as seconds, and seconds that are read as milliseconds."""

import numpy as np
import pytest
from ingest_world import calm, changed, sensor, vehicle, with_sensor

from auvident.errors import InputError
from auvident.stages.ingest import ingest


def in_unit(raw, name, factor, late_s=0.0):
    """The trial with the time of one sensor a factor of what it is."""
    return changed(raw, name, time_s=(raw.sensors[name].time_s + late_s) * factor)


def with_depth():
    time = np.arange(0.0, 60.0, 0.2)
    return with_sensor(calm(duration_s=60.0), sensor("depth", time, depth_m=4.0 + 0.01 * time))


def units(quality):
    return [f for f in quality.findings if f.code == "time_unit"]


@pytest.mark.parametrize(("factor", "unit"), [(1e3, "ms"), (1e-3, "s")])
def test_a_sensor_that_lasts_a_thousand_times_as_long_is_told(factor, unit):
    (told,) = units(ingest(in_unit(with_depth(), "depth", factor), vehicle())[1])
    assert "depth lasts" in told.message
    assert f'[depth] time_unit = "{unit}"' in told.remedy
    assert not units(ingest(with_depth(), vehicle())[1])


def test_needed_sensors_that_never_overlap_name_the_unit():
    raw = calm(duration_s=60.0)
    for name in ("dvl", "gyro", "rpm"):
        raw = in_unit(raw, name, 1.0, late_s=100.0)
    with pytest.raises(InputError, match="never overlap") as caught:
        ingest(in_unit(raw, "rudder", 1e3, late_s=100.0), vehicle())
    assert '[rudder] time_unit = "ms"' in (caught.value.remedy or "")


@pytest.mark.parametrize("rate_hz", [1.0, 5.0, 8.0])
def test_a_trial_that_is_over_within_some_lengths_is_told(rate_hz):
    """Slower than 9 Hz it is not beyond what the fastest gyro delivers."""
    raw = calm(rate_hz=rate_hz, duration_s=1000.0)
    quick = raw
    for name in raw.sensors:
        quick = in_unit(quick, name, 1e-3)
    (told,) = units(ingest(quick, vehicle())[1])
    assert "seconds read as milliseconds" in told.message
    assert not units(ingest(raw, vehicle())[1])


def test_a_simulation_of_a_thousand_rows_a_second_is_none():
    assert not units(ingest(calm(rate_hz=1000.0, duration_s=40.0), vehicle())[1])


def test_sensors_that_begin_past_midnight_are_put_a_day_later():
    raw = calm(duration_s=60.0)
    for name in raw.sensors:
        late = 86399.9 if name == "gyro" else 0.0
        raw = in_unit(raw, name, 1.0, late_s=late)
    with pytest.raises(InputError, match="never overlap") as caught:
        ingest(raw, vehicle())
    for name in ("dvl", "rudder", "rpm"):
        assert f"[{name}] time_offset_s = 86400" in (caught.value.remedy or "")
    assert "[gyro]" not in (caught.value.remedy or "")


def test_a_depth_that_begins_past_midnight_is_told():
    raw = with_depth()
    for name in ("dvl", "gyro", "rudder", "rpm"):
        raw = in_unit(raw, name, 1.0, late_s=86399.9)
    quality = ingest(raw, vehicle())[1]
    (told,) = [f for f in quality.findings if f.code == "clock_day"]
    assert "[depth] time_offset_s = 86400" in told.remedy


def test_a_log_with_its_newest_row_first_is_to_be_sorted():
    raw = calm(duration_s=60.0)
    raw = changed(raw, "dvl", time_s=raw.sensors["dvl"].time_s[::-1])
    with pytest.raises(InputError, match="the newest row comes first") as caught:
        ingest(raw, vehicle())
    assert "Sort the rows by time" in (caught.value.remedy or "")
