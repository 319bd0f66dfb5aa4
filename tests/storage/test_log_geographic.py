"""Position logged as latitude and longitude: north and east from the first fix."""

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest
from log_world import sensor_tables, wide_table, write_folder
from pyarrow import parquet

from auvident.errors import InputError
from auvident.stages.ingest import ingest
from auvident.storage.log_geographic import from_first_fix
from auvident.storage.log_inspect import inspect_log
from auvident.storage.logs import read_column_map, read_trials
from tests.stages.ingest_world import vehicle

A, F = 6378137.0, 1 / 298.257223563  # WGS 84, NIMA TR8350.2
E2 = F * (2 - F)
BAY = (36.8, -121.9)
TIME_S = np.arange(100.0, 130.0, 0.5)
DEG = ("latitude_deg", "longitude_deg")


def circle(radius_m=150.0):
    """North and east of a turn that begins at the origin."""
    turned = 2 * np.pi * (TIME_S - TIME_S[0]) / 20.0
    return radius_m * np.sin(turned), radius_m * (1 - np.cos(turned))


def degrees(north_m, east_m, at=BAY):
    """Latitude and longitude of points of the plane that touches the ellipsoid at a place.

    Closed form to earth-centred axes, back by iteration: neither uses a radius of curvature
    along the meridian, which the program does.
    """
    lat, lon = np.deg2rad(at)
    across = A / np.sqrt(1 - E2 * np.sin(lat) ** 2)
    # in the meridian of the place: outwards along the equator, to the east, along the axis
    outwards = across * np.cos(lat) - north_m * np.sin(lat)
    axis = across * (1 - E2) * np.sin(lat) + north_m * np.cos(lat)
    found_lon = lon + np.arctan2(east_m, outwards)
    away = np.hypot(outwards, east_m)
    found = np.arctan2(axis, away * (1 - E2))
    for _ in range(10):
        n = A / np.sqrt(1 - E2 * np.sin(found) ** 2)
        found = np.arctan2(axis + E2 * n * np.sin(found), away)
    wrapped = (np.rad2deg(found_lon) + 180.0) % 360.0 - 180.0
    return np.rad2deg(found), wrapped


def bound_m(north_m, east_m, at=BAY):
    """By how much arcs may differ from the plane: meridians that converge, radii that change."""
    square = np.max(north_m**2 + east_m**2)
    return square * (abs(np.tan(np.deg2rad(at[0]))) / 2 + 0.005) / 6.35e6 + 1e-4


def fixes(names=DEG, scale=1.0, track=None, at=BAY):
    north, east = track or circle()
    lat, lon = degrees(north, east, at)
    return pd.DataFrame({"time_s": TIME_S, names[0]: scale * lat, names[1]: scale * lon})


def folder_with(folder, position, name="position"):
    return write_folder(folder, sensor_tables() | {name: position})


def read(folder, text=""):
    path = folder.parent / "map.toml"
    path.write_text(text)
    (trial,) = read_trials([folder], read_column_map(path))
    return trial


def assert_is_circle(trial, at=BAY, track=None):
    north, east = track or circle()
    values = trial.sensors["position"].values
    assert list(values) == ["north_m", "east_m"]
    most = bound_m(north, east, at)
    np.testing.assert_allclose(values["north_m"], north - north[0], atol=most)
    np.testing.assert_allclose(values["east_m"], east - east[0], atol=most)


@pytest.mark.parametrize("lat", [0.0, 36.8, -60.0, 78.0])
@pytest.mark.parametrize("radius_m", [150.0, 1500.0])
def test_arcs_are_the_plane_within_the_convergence_of_meridians(lat, radius_m):
    """At 300 m from the first fix 3 cm in 78 degrees of latitude, at 3 km 3.3 m."""
    track, at = circle(radius_m), (lat, 20.0)
    found = from_first_fix(*np.deg2rad(degrees(*track, at)))
    for own, true in zip(found, track, strict=True):
        np.testing.assert_allclose(own, true, atol=bound_m(*track, at))
    assert bound_m(*circle(150.0), BAY) < 0.01


@pytest.mark.parametrize(
    ("names", "scale"),
    [
        (DEG, 1.0),
        (("lat_deg", "lon_deg"), 1.0),
        (("Lat_deg", "Long_deg"), 1.0),
        (("latitude [deg]", "longitude [deg]"), 1.0),
        (("lat (degrees_north)", "lng (degrees_east)"), 1.0),
        (("latitude_rad", "longitude_rad"), np.pi / 180),
    ],
)
def test_columns_that_say_their_unit_are_read_by_name(tmp_path, names, scale):
    folder = folder_with(tmp_path / "run", fixes(names, scale))
    trial = read(folder)
    assert_is_circle(trial)
    assert trial.sensors["position"].columns["north_m"] == names[0].partition(" ")[0]
    assert inspect_log(folder).proposed_map == ""


def test_a_row_of_units_says_it_as_well(tmp_path):
    folder = folder_with(tmp_path / "run", fixes(("lat", "lon")))
    head, *rows = (folder / "position.csv").read_text().splitlines()
    (folder / "position.csv").write_text("\n".join([head, "s,deg,deg", *rows]))
    assert_is_circle(read(folder))


@pytest.mark.parametrize("unit", ["", "deg"])
def test_parquet(tmp_path, unit):
    folder = write_folder(tmp_path / "run")
    names = ("lat", "lon") if unit else DEG
    table = pa.Table.from_pandas(fixes(names), preserve_index=False)
    about = {"unit": unit} if unit else None
    fields = [f.with_metadata(about) if f.name in names else f for f in table.schema]
    parquet.write_table(table.cast(pa.schema(fields)), folder / "position.parquet")
    assert_is_circle(read(folder))


def test_columns_of_a_wide_file(tmp_path):
    table = wide_table()
    lat, lon = degrees(table["time_s"].to_numpy(), 0.0 * table["time_s"].to_numpy())
    table.assign(latitude_deg=lat, longitude_deg=lon).to_csv(tmp_path / "wide.csv", index=False)
    (trial,) = read_trials([tmp_path / "wide.csv"])
    north = trial.sensors["position"].values["north_m"]
    np.testing.assert_allclose(north, table["time_s"] - table["time_s"].iloc[0], atol=1e-3)


@pytest.mark.parametrize(
    ("scale", "unit"),
    [(1.0, 'unit = "deg"'), (1e7, 'unit = "deg", scale = 1e-7'), (np.pi / 180, 'unit = "rad"')],
)
def test_a_map_says_it_of_any_columns(tmp_path, scale, unit):
    position = fixes(("a", "b"), scale)
    if scale == 1e7:
        position[["a", "b"]] = np.rint(position[["a", "b"]]).astype(np.int64)
    folder = folder_with(tmp_path / "run", position, "gps")
    entries = f'north = {{ column = "a", {unit} }}\neast = {{ column = "b", {unit} }}'
    trial = read(folder, f'[position]\nfile = "gps.csv"\n{entries}\n')
    north, east = circle()
    values = trial.sensors["position"].values  # 1e-7 degrees are 11 mm
    np.testing.assert_allclose(values["north_m"], north, atol=bound_m(north, east) + 0.012)
    np.testing.assert_allclose(values["east_m"], east, atol=bound_m(north, east) + 0.012)


def test_a_longitude_that_is_positive_to_the_west(tmp_path):
    position = fixes(("lat", "west"))
    position["west"] *= -1.0
    entries = '[position]\nnorth = { column = "lat", unit = "deg" }\n'
    entries += 'east = { column = "west", unit = "deg", sign = -1 }\n'
    assert_is_circle(read(folder_with(tmp_path / "run", position), entries))


@pytest.mark.parametrize(
    "entries",
    [
        'north = { column = "lat", unit = "deg" }',
        'east = { column = "lon", unit = "rad" }',
        'north = { column = "lat", unit = "deg" }\neast = { column = "lon", unit = "m" }',
        'north = { column = "lat", unit = "deg" }\neast = { column = "x_m" }',
        'north = "latitude_deg"\neast = "x_m"',
    ],
)
def test_one_of_the_two_in_a_map_is_refused(tmp_path, entries):
    position = fixes().assign(lat=36.8, lon=-121.9, x_m=TIME_S)
    with pytest.raises(InputError) as caught:
        read(folder_with(tmp_path / "run", position), f"[position]\n{entries}\n")
    for word in ("alone is an angle", "go together", 'east = { column = "lon", unit = "deg" }'):
        assert word in str(caught.value)


@pytest.mark.parametrize("left", DEG)
def test_one_of_the_two_by_name_is_refused(tmp_path, left):
    position = fixes()[["time_s", left]]
    with pytest.raises(InputError) as caught:
        read(folder_with(tmp_path / "run", position))
    assert left in str(caught.value)
    assert "[position]" in caught.value.remedy


def test_a_map_without_the_unit_is_told_degrees(tmp_path):
    folder = folder_with(tmp_path / "run", fixes(("lat", "lon")))
    with pytest.raises(InputError) as caught:
        read(folder, '[position]\nnorth = "lat"\neast = "lon"\n')
    assert 'north = { column = "lat", unit = "deg" }' in caught.value.remedy


@pytest.mark.parametrize("lon", [179.9995, -179.9995, 180.0])
def test_the_date_line(tmp_path, lon):
    at = (-17.0, lon)
    folder = folder_with(tmp_path / "run", fixes(at=at))
    assert_is_circle(read(folder), at)


@pytest.mark.parametrize("lon", [-122.0, 0.0, 20.0])
def test_a_longitude_that_is_counted_eastward_all_around(tmp_path, lon):
    at = (36.8, lon)
    position = fixes(at=at)
    position["longitude_deg"] %= 360.0
    folder = folder_with(tmp_path / "run", position)
    trial = read(folder)
    assert trial.sensors["position"].dropped == {}
    assert_is_circle(trial, at)


def test_rows_without_a_fix_and_beyond_the_globe_are_left_out_and_counted(tmp_path):
    position = fixes()
    position.loc[[0, 1, 30], DEG] = 0.0
    position.loc[[7], "latitude_deg"] = 90.5
    position.loc[[9], "longitude_deg"] = -999.0
    position.loc[[11], "latitude_deg"] = np.nan
    folder = folder_with(tmp_path / "run", position)
    raw = read(folder)
    found = raw.sensors["position"]
    assert found.dropped == {"no_fix": 3, "implausible": 2}
    assert found.dropped_rows == {"no_fix": (2, 3, 32), "implausible": (9, 11)}
    north, _ = circle()
    kept = np.delete(np.arange(TIME_S.size), [0, 1, 30, 7, 9])
    wanted = np.where(kept == 11, np.nan, north[kept] - north[2])
    np.testing.assert_allclose(found.values["north_m"], wanted, atol=0.05)
    _, quality = ingest(raw, vehicle(signs={"rudder_positive_turns": "starboard"}))
    (sensor,) = [s for s in quality.sensors if s.sensor == "position"]
    assert {reason: d.count for reason, d in sensor.dropped.items()} == found.dropped


def test_no_fix_at_all_is_a_finding(tmp_path):
    raw = read(folder_with(tmp_path / "run", fixes().assign(**dict.fromkeys(DEG, 0.0))))
    _, quality = ingest(raw, vehicle(signs={"rudder_positive_turns": "starboard"}))
    unusable = [f.message for f in quality.findings if f.code == "channel_unusable"]
    assert any("latitude_deg" in message for message in unusable)
    assert "north_m" in quality.absent


def test_a_wild_first_reading_is_no_origin():
    """Its cosine would scale every easting."""
    north, east = circle()
    lat, lon = np.deg2rad(degrees(north, east))
    lat[0], lon[0] = 1e-9, 1e-9
    found = from_first_fix(lat, lon)
    np.testing.assert_allclose(found[0][1:], north[1:] - north[1], atol=0.02)
    np.testing.assert_allclose(found[1][1:], east[1:] - east[1], atol=0.02)
    assert np.hypot(found[0][0], found[1][0]) > 1e6


def test_marked_rows_are_no_origin(tmp_path):
    position = fixes().assign(valid=1)
    position.loc[0, ["latitude_deg", "valid"]] = (36.9, 0)
    found = read(folder_with(tmp_path / "run", position)).sensors["position"]
    assert found.dropped == {"marked_invalid": 1}
    assert found.values["north_m"][0] == 0.0


def test_each_trial_counts_from_its_own_first_fix(tmp_path):
    for name, at in {"a": BAY, "b": (36.81, -121.95)}.items():
        folder_with(tmp_path / "runs" / name, fixes(at=at))
    for trial, at in zip(read_trials([tmp_path / "runs"]), (BAY, (36.81, -121.95)), strict=True):
        assert_is_circle(trial, at)


def test_metres_count_before_degrees(tmp_path):
    position = fixes().assign(north_m=1.0, east_m=2.0)
    values = read(folder_with(tmp_path / "one", position)).sensors["position"].values
    assert (set(values["north_m"]), set(values["east_m"])) == ({1.0}, {2.0})
    folder = folder_with(tmp_path / "two", fixes(), "gps")
    position[["time_s", "north_m", "east_m"]].to_csv(folder / "nav.csv", index=False)
    assert read(folder).sensors["position"].file.endswith("nav.csv")


def test_of_several_tables_of_fixes_none_is_taken_without_a_map(tmp_path):
    folder = folder_with(tmp_path / "run", fixes(), "gps")
    fixes().to_csv(folder / "usbl.csv", index=False)
    trial = read(folder)
    assert "position" not in trial.sensors
    (finding,) = trial.findings
    assert "gps.csv, usbl.csv" in finding.message
    assert '[position] file = "gps.csv"' in finding.remedy
    assert_is_circle(read(folder, '[position]\nfile = "gps.csv"\n'))
    proposed = inspect_log(folder).proposed_map
    assert '[position]\nfile = "gps.csv"' in proposed
    assert_is_circle(read(folder, proposed))


def test_columns_of_fixes_alone_are_read_where_they_stand(tmp_path):
    assert_is_circle(read(folder_with(tmp_path / "run", fixes(), "gps")))


@pytest.mark.parametrize(
    ("names", "scale", "unit"),
    [
        (("lat", "lon"), 1.0, 'unit = "deg"'),
        (("Latitude", "Longitude"), 1.0, 'unit = "deg"'),
        (("lat", "lng"), np.pi / 180, 'unit = "rad"'),
        (("GPS_lat", "GPS_long"), 1.0, 'unit = "deg"'),
        (("lat", "lon"), 1e7, 'unit = "deg", scale = 1e-7'),
    ],
)
def test_inspect_proposes_latitude_and_longitude(tmp_path, names, scale, unit):
    position = fixes(names, scale)
    if scale == 1e7:
        position[[*names]] = np.rint(position[[*names]]).astype(np.int64)
    folder = folder_with(tmp_path / "run", position)
    text = inspect_log(folder).proposed_map
    assert f'north = {{ column = "{names[0]}", {unit} }}' in text
    assert f'east = {{ column = "{names[1]}", {unit} }}' in text
    north, _ = circle()
    values = read(folder, text).sensors["position"].values
    np.testing.assert_allclose(values["north_m"], north, atol=0.05)


@pytest.mark.parametrize(
    "columns",
    [
        {"lat": 3648.12 + 0.01 * TIME_S, "lon": -12154.5 + 0.01 * TIME_S},  # degrees and minutes
        {"lat": 36.8 + 1e-5 * TIME_S},
        {"lat": 36.8, "gps_lon": -121.9},
        {"lat": 0.0, "lon": 0.0},
    ],
)
def test_inspect_proposes_nothing_else(tmp_path, columns):
    position = pd.DataFrame({"time_s": TIME_S, **columns})
    assert inspect_log(folder_with(tmp_path / "run", position)).proposed_map == ""


def test_inspect_says_what_the_columns_were_taken_for(tmp_path):
    report = inspect_log(folder_with(tmp_path / "run", fixes()))
    (file,) = [f for f in report.files if f.file.endswith("position.csv")]
    assert [c.quantity for c in file.columns] == [None, "north", "east"]


def test_knots_are_told_by_fixes_as_well(tmp_path):
    t = np.arange(0.0, 600.0, 0.5)
    track = (1.6 * t, 0.0 * t)
    lat, lon = degrees(*track)
    tables = sensor_tables(0.0)
    tables["dvl"] = pd.DataFrame({"t": t, "surge": 1.6 * 3600 / 1852, "sway": 0.02 * np.sin(t)})
    tables["position"] = pd.DataFrame({"t": t, "lat": lat, "lon": lon})
    text = inspect_log(write_folder(tmp_path / "run", tables)).proposed_map
    assert '{ column = "surge", unit = "kn" }' in text


def test_degrees_and_minutes_of_nmea_are_told(tmp_path):
    table = fixes()
    for name in DEG:
        whole = np.floor(np.abs(table[name]))
        table[name] = 100.0 * whole + 60.0 * (np.abs(table[name]) - whole)
    (trial,) = read_trials([folder_with(tmp_path / "run", table)])
    assert trial.sensors["position"].dropped["implausible"] == len(table)
    (told,) = [f for f in trial.findings if f.code == "degrees_and_minutes"]
    assert "ddmm.mmmm" in told.message and "mm.mmmm / 60" in (told.remedy or "")


@pytest.mark.parametrize("scale", [1e7, 3600.0, 57.29578])
def test_latitudes_in_another_unit_are_not_taken_for_minutes(tmp_path, scale):
    (trial,) = read_trials([folder_with(tmp_path / "run", fixes(scale=scale))])
    assert not [f for f in trial.findings if f.code == "degrees_and_minutes"]
