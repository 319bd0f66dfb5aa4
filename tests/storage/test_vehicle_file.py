import re
from pathlib import Path

import pytest

from auvident.errors import InputError
from auvident.storage.declared import outside_allowed
from auvident.storage.vehicle_file import load_vehicle

VEHICLES = Path(__file__).parents[1] / "data" / "vehicles"
ROOT = Path(__file__).parents[2]
REMUS = (VEHICLES / "remus.toml").read_text()


def refused(tmp_path, text, name="vehicle.toml"):
    path = tmp_path / name
    path.write_text(text)
    with pytest.raises(InputError) as error:
        load_vehicle(path)
    assert error.value.exit_code == 3
    assert str(path) in str(error.value)
    assert error.value.remedy
    return str(error.value)


@pytest.mark.parametrize("path", sorted(VEHICLES.glob("*.toml")), ids=lambda p: p.stem)
def test_vehicles_load(path):
    assert load_vehicle(path).body.name


IMPOSSIBLE = [  # what is replaced, by what, what the message must name
    ("nose_length_m = 0.1745", "nose_length_m = 0.9", ["0.9", "0.502", "1.33", "nose_length_m"]),
    ("theta_deg = 24.98", "theta_deg = 35.0", ["35", "27.9", "myring_theta_deg"]),
    ("diameter_m = 0.191", "diameter_m = 1.91", ["1.91", "1.33", "diameter_m"]),
    ("myring_n = 2.0", "tail_base_diameter_m = 0.3", ["0.3", "0.191", "tail_base_diameter_m"]),
    ("origin_from_nose_m = 0.611", "origin_from_nose_m = 2.0", ["2", "1.33", "origin"]),
    ("z_g_m = 0.0196", "x_g_m = 0.9", ["x_g_m", "-0.289", "1.33"]),
    ("z_g_m = 0.0196", "z_g_m = 0.2", ["z_g_m", "0.2", "0.0955"]),
    ("mass_kg = 30.48", "mass_kg = 304.8", ["304.8", "32.5", "mass_kg"]),
    ("mass_kg = 30.48", "mass_kg = 3.048", ["3.048", "32.5"]),
    ("izz_kgm2 = 3.45", "izz_kgm2 = 345.0", ["izz_kgm2", "gyration"]),
    ("z_g_m = 0.0196", "buoyancy_n = 31.0", ["buoyancy_n", "31 N", "298.9 N"]),
    ("z_g_m = 0.0196", "buoyancy_std_n = 500.0", ["buoyancy_std_n", "500 N", "298.9 N"]),
    ("z_g_m = 0.0196", "x_g_std_m = 2.0", ["x_g_std_m", "2 m", "1.33"]),
    ("z_g_m = 0.0196", "z_g_std_m = 0.2", ["z_g_std_m", "0.2 m", "0.0955"]),
    ("x_m = -0.638", "x_m = -6.38", ["[[fin]] 1 (rudder)", "-6.38", "-0.719"]),
    ("x_m = -0.638", "x_m = 0.9", ["[[fin]] 1", "0.9", "0.611"]),
    ("root_chord_m = 0.0903", "root_chord_m = 9.03", ["9.03", "1.33", "root_chord_m"]),
    ("exposed_span_m = 0.0857", "exposed_span_m = 8.57", ["8.57", "1.33", "exposed_span_m"]),
    (
        "x_m = -0.638\nexposed_span_m = 0.0857",
        "x_m = -0.7\nexposed_span_m = 0.001",
        ["inside the hull", "exposed_span_m"],
    ),
]


@pytest.mark.parametrize(("old", "new", "words"), IMPOSSIBLE, ids=[i[1][:40] for i in IMPOSSIBLE])
def test_impossible_geometry_is_refused_with_both_numbers(tmp_path, old, new, words):
    assert old in REMUS
    message = refused(tmp_path, REMUS.replace(old, new, 1))
    for word in words:
        assert word in message


WRONG = [
    ("mass_kg = 30.48", "mass_kg = -1.0", ["[vehicle] mass_kg", "-1"]),
    ("mass_kg = 30.48", "mass_kg = 'x'", ["[vehicle] mass_kg"]),
    ("mass_kg = 30.48\n", "", ["[vehicle] mass_kg", "missing"]),
    ("mass_kg = 30.48", "mass_kg = 30.48\nmass_lb = 3.0", ["mass_lb", "unknown key"]),
    ("izz_kgm2", "izz_kgm", ["izz_kgm2: is missing", "unknown key, did you mean izz_kgm2?"]),
    ("x_m = -0.638", "x = -0.638", ["[[fin]] 1 x: unknown key, did you mean x_m?"]),
    ("[propeller]", "[propellor]", ["[propellor] unknown key, did you mean propeller?"]),
    ("30.48", "'30.48 kg'", ["[vehicle] mass_kg: should be a valid number, not '30.48 kg'"]),
    ("mass_kg = 30.48", "mass_kg = inf", ["[vehicle] mass_kg"]),
    ('kind = "rudder"', 'kind = "keel"', ["[[fin]] 1 kind: should be", "keel"]),
    ("diameter_m = 0.191\n", "", ["[hull]", "diameter_m", "beam_m"]),
    ("kt1 = -0.41737\n", "", ["[propeller]", "kt1"]),
    ("[fluid]", "[coefficients]\nY_q = { value = 1.0, std = 1.0 }\n[fluid]", ["Y_q"]),
    ("[fluid]", "[[[fluid]", ["TOML"]),
    ("[fluid]", "[ase]\nhull_station = 'middle'\n[fluid]", ["[ase] hull_station", "middle"]),
]


@pytest.mark.parametrize(("old", "new", "words"), WRONG, ids=[w[1][:30] for w in WRONG])
def test_wrong_files_are_refused_with_table_and_key(tmp_path, old, new, words):
    assert old in REMUS
    path = tmp_path / "v.toml"
    path.write_text(REMUS.replace(old, new, 1))
    with pytest.raises(InputError) as error:
        load_vehicle(path)
    for word in [str(path), *words]:
        assert word in str(error.value)


def test_missing_file(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        load_vehicle(tmp_path / "none.toml")


def with_offsets(tmp_path, rows, header="x_from_nose_m,radius_m"):
    """REMUS with its hull from an offsets file beside it."""
    (tmp_path / "hull.csv").write_text("\n".join([header, *rows]) + "\n")
    head, _, rest = REMUS.partition("[hull]")
    fins = rest[rest.index("[[fin]]") :]
    return f'{head}[hull]\nlength_m = 1.33\noffsets = "hull.csv"\n\n{fins}'


GOOD = [
    "0,0.04",
    "0.05,0.07",
    "0.1745,0.0955",
    "0.5,0.0955",
    "0.8285,0.0955",
    "1.0,0.09",
    "1.15,0.07",
    "1.25,0.046",
    "1.33,0.017",
]


def test_offsets_are_read_beside_the_vehicle_file(tmp_path):
    path = tmp_path / "v.toml"
    path.write_text(with_offsets(tmp_path, GOOD))
    hull = load_vehicle(path).hull
    assert hull.family == "offsets"
    assert hull.offsets_x_from_nose_m[:2] == (0.0, 0.05)
    assert hull.offsets_radius_m[-1] == 0.017


def test_offsets_with_semicolons_comments_and_more_columns(tmp_path):
    rows = [
        f"{r.split(',')[1].replace('.', ',')};{r.split(',')[0].replace('.', ',')};x" for r in GOOD
    ]
    path = tmp_path / "v.toml"
    path.write_text(with_offsets(tmp_path, ["# drawing 7", *rows], "radius_m;x_from_nose_m;note"))
    assert load_vehicle(path).hull.offsets_radius_m[0] == 0.04


BAD_OFFSETS = [
    ([*GOOD[:3], "0.1,0.09", *GOOD[3:]], ["do not ascend", "0.1", "0.1745"]),
    ([*GOOD[:3], "0.3,-0.09", *GOOD[3:]], ["-0.09", "negative"]),
    (GOOD[:3], ["3 points"]),
    (GOOD[:-2], ["1.15", "1.33", "length_m"]),
    ([f"{r.split(',')[0]},0" for r in GOOD], ["zero"]),
]


@pytest.mark.parametrize(("rows", "words"), BAD_OFFSETS, ids=[b[1][0] for b in BAD_OFFSETS])
def test_impossible_offsets_are_refused(tmp_path, rows, words):
    message = refused(tmp_path, with_offsets(tmp_path, rows))
    for word in words:
        assert word in message


@pytest.mark.parametrize(
    ("rows", "header", "words"),
    [
        (["0,0.04", "0.1,wide"], "x_from_nose_m,radius_m", ["row 3", "radius_m", "wide"]),
        (["0,0.04", "0.1"], "x_from_nose_m,radius_m", ["row 3", "radius_m"]),
        (GOOD, "x,r", ["x_from_nose_m"]),
    ],
)
def test_unreadable_offsets_name_their_place(tmp_path, rows, header, words):
    path = tmp_path / "v.toml"
    path.write_text(with_offsets(tmp_path, rows, header))
    with pytest.raises(InputError) as error:
        load_vehicle(path)
    for word in ["hull.csv", *words]:
        assert word in str(error.value)


def test_missing_offsets_file_is_named(tmp_path):
    text = with_offsets(tmp_path, GOOD).replace("hull.csv", "other.csv")
    assert "other.csv" in refused(tmp_path, text)


BEYOND = [  # key, value, the unit that its limits go by
    ("mass_kg", "1e200"),
    ("izz_kgm2", "1e-200"),
    ("root_chord_m", "1e-200"),
    ("x_g_m", "1e300"),
    ("origin_from_nose_m", "1e200"),
    ("design_speed_mps", "1e6"),
    ("length_m", "1e200"),
    ("diameter_m", "1e200"),
]


@pytest.mark.parametrize(("key", "value"), BEYOND)
def test_numbers_that_no_vehicle_has_are_refused_before_they_overflow(tmp_path, key, value):
    text, count = re.subn(rf"(?m)^{key} = .*$", f"{key} = {value}", REMUS, count=1)
    text = text if count else REMUS.replace("[vehicle]", f"[vehicle]\n{key} = {value}")
    message = refused(tmp_path, text)
    assert key in message
    assert "is not between" in message


@pytest.mark.parametrize("base", ["0.0", "7e-5", "1e-200"])
def test_a_tail_may_end_in_a_point(tmp_path, base):
    path = tmp_path / "vehicle.toml"
    path.write_text(REMUS.replace("[hull]", f"[hull]\ntail_base_diameter_m = {base}"))
    assert load_vehicle(path).hull.tail_base_diameter_m == float(base)


def test_a_propeller_of_another_world_is_refused(tmp_path):
    text = (
        f"{REMUS.split('[propeller]')[0]}[propeller]\ndiameter_m = 1e200\nkt0 = 0.4\nkt1 = -0.4\n"
    )
    assert "[propeller].diameter_m" in refused(tmp_path, text)


def test_a_name_and_a_list_of_fins_have_an_end(tmp_path):
    name = re.sub(r'name = ".*"', f'name = "{"n" * 201}"', REMUS, count=1)
    assert "201 characters" in refused(tmp_path, name)
    fin = '[[fin]]\nkind = "rudder"\nx_m = -0.6\nexposed_span_m = 0.1\nroot_chord_m = 0.1\n'
    assert "sets of fins" in refused(tmp_path, REMUS + (fin + "tip_chord_m = 0.1\n") * 3000)


ELSEWHERE = [
    "../hull.csv",
    "{folder}/../hull.csv",
    "sub/../../hull.csv",
    "link/hull.csv",
    "/dev/zero",
]


@pytest.mark.parametrize("name", ELSEWHERE)
def test_offsets_stay_in_the_folder_of_the_vehicle_file(tmp_path, name):
    folder = tmp_path / "vehicle"
    folder.mkdir()
    (folder / "link").symlink_to("..")
    text = with_offsets(tmp_path, GOOD)  # the offsets file stands above
    text = text.replace("hull.csv", name.format(folder=folder))
    message = refused(folder, text)
    assert "outside" in message
    assert "--allow-outside" in message
    with outside_allowed(True):
        if "dev" in name:
            with pytest.raises(InputError, match="a device"):
                load_vehicle(folder / "vehicle.toml")
        elif "sub" not in name:  # a folder that is not there leads nowhere
            assert load_vehicle(folder / "vehicle.toml").hull.family == "offsets"


@pytest.mark.parametrize("name", ["", " ", "\\u0000"])
def test_a_name_that_is_none_is_no_offsets_file(tmp_path, name):
    text = with_offsets(tmp_path, GOOD).replace("hull.csv", name)
    with pytest.raises(InputError, match=r"not a file name"):
        path = tmp_path / "v.toml"
        path.write_text(text)
        load_vehicle(path)


def test_a_list_of_tables_that_is_written_as_one_says_how(tmp_path):
    """Once, where the tables were read; twice, where it is no TOML."""
    head, _, fin = REMUS.partition("[[fin]]")
    one = f"{head}[fin]{fin.partition('[[fin]]')[0]}"
    assert "[fin] is one of a list of tables: write [[fin]]" in refused(tmp_path, one)
    assert "[[name]]" in refused(tmp_path, REMUS.replace("[[fin]]", "[fin]"))


def test_two_propellers_are_told_to_be_one_table(tmp_path):
    table = "[[propeller]]\ndiameter_m = 0.14\nkt0 = 0.3\nkt1 = -0.4\n"
    without = re.sub(r"\[propeller\]\n(?:[^\[\n].*\n|\n)*", "", REMUS)
    said = refused(tmp_path, without + table + table)
    assert "[propeller] is one table" in said and "times their number" in said
    assert "diameter_m" not in said  # no dump of what was written
