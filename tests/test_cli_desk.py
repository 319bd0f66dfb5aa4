"""`auvident simulate --maneuver`: what it prints and writes, from every target; what it refuses."""

import json
import math
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import auvident as interface
from auvident.pipeline.desk import SPEED_ASSUMED
from auvident.pipeline.observer import Observer
from tests.command_line import SAMPLES, Called

VEHICLE = "sample_logs/remus100.toml"
Call = Callable[..., Called]


@pytest.fixture
def samples(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the sample logs; the current one."""
    (tmp_path / "sample_logs").symlink_to(SAMPLES)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def result_of(called: Called) -> dict:
    assert called.code == 0, called.err
    found = json.loads(called.out)
    assert found["schema"] == "auvident/desk/1"
    return dict(found)


def test_json_has_figures_with_intervals_and_the_motion(samples: Path, auvident: Call) -> None:
    found = result_of(auvident("simulate", VEHICLE, "--maneuver", "zigzag:20/10", "--json"))
    assert found["maneuver"] == "zigzag"
    assert found["parameters"] == {"rudder_deg": 20.0, "heading_deg": 10.0}
    assert found["source"] == "estimated"
    assert found["speed_mps"] == pytest.approx(1.5)  # as the vehicle file says
    figures = {f["name"]: f for f in found["figures"]}
    first = figures["overshoot_1"]
    assert first["unit"] == "deg"
    assert first["low"] <= first["value"] <= first["high"]
    assert {"nomoto_gain", "stability_index", "period"} <= set(figures)
    columns = found["columns"]
    assert {"time_s", "rudder_rad", "u_mps", "north_m", "r_radps_low", "r_radps_high"} <= set(
        columns
    )
    assert len({len(values) for values in columns.values()}) == 1


@pytest.mark.parametrize("maneuver", ["depth-step:5", "vertical-zigzag:10/5"])
def test_a_vehicle_file_flies_up_and_down_with_its_ballast_drawn(
    samples: Path, auvident: Call, maneuver: str
) -> None:
    found = result_of(auvident("simulate", VEHICLE, "--maneuver", maneuver, "--json"))
    assert found["source"] == "estimated"
    assert any(f["low"] < f["value"] < f["high"] for f in found["figures"])


def test_tables_and_pictures_are_written(samples: Path, auvident: Call) -> None:
    base = ("simulate", VEHICLE, "--maneuver", "turning-circle:15")
    called = auvident(*base, "--output", "c.csv", "--figure", "c.svg")
    assert called.code == 0, called.err
    assert "tactical diameter" in called.err
    assert "90 % interval" in called.err
    assert "rows written to c.csv" in called.err
    assert called.out == ""
    assert auvident(*base, "--output", "c.parquet", "--figure", "c.png").code == 0
    table = pd.read_csv("c.csv")
    pd.testing.assert_frame_equal(table, pd.read_parquet("c.parquet"))
    assert abs(table["heading_rad"].iloc[-1]) == pytest.approx(math.radians(540.0), rel=0.01)
    assert table["rudder_rad"].iloc[-1] == pytest.approx(-math.radians(15.0))
    assert Path("c.svg").read_text().lstrip().startswith("<?xml")
    assert Path("c.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    "maneuver", ["spiral:20", "pull-out", "depth-step:-3", "vertical-zigzag:10/5"]
)
def test_every_maneuver_is_told_and_drawn(samples: Path, auvident: Call, maneuver: str) -> None:
    called = auvident("simulate", VEHICLE, "--maneuver", maneuver, "--figure", "f.svg")
    assert called.code == 0, called.err
    assert Path("f.svg").stat().st_size > 10_000
    assert "stability index G" in called.err


def test_figures_of_the_vertical_plane_are_told_in_its_words(samples: Path, auvident: Call) -> None:
    words = ("time to check yaw", "back on the course")
    up = auvident("simulate", VEHICLE, "--maneuver", "vertical-zigzag:10/5").err
    assert "time to check pitch" in up and not any(word in up for word in words)
    aside = auvident("simulate", VEHICLE, "--maneuver", "zigzag").err
    assert all(word in aside for word in words)


@pytest.mark.parametrize("maneuver", ["spiral:20", "pull-out"])
def test_what_has_died_away_is_zero_without_a_sign(
    samples: Path, auvident: Call, maneuver: str
) -> None:
    told = auvident("simulate", VEHICLE, "--maneuver", maneuver, "--samples", "10").err
    assert not re.search(r"[-−]0(\.0*)?(?![\d.])|e[-−]\d", told), told


def test_a_bare_number_is_no_coefficient(samples: Path, auvident: Call) -> None:
    Path("v.toml").write_text(Path(VEHICLE).read_text() + "\n[coefficients]\nY_uv = -28.6\n")
    called = auvident("simulate", "v.toml", "--maneuver", "zigzag")
    assert called.code == 3
    assert called.err.count("{ value = ..., std = ... }") == 1
    assert "[coefficients] Y_uv: -28.6 has no standard deviation" in called.err
    assert "Known" not in called.err


def test_a_seed_repeats_and_samples_can_be_left_out(samples: Path, auvident: Call) -> None:
    base = ("simulate", VEHICLE, "--maneuver", "zigzag", "--json", "--samples", "30")
    first, again, other = (auvident(*base, "--seed", seed).out for seed in "001")
    assert first == again != other
    alone = result_of(auvident(*base[:-1], "0"))
    values = [{f["name"]: f["value"] for f in json.loads(t)["figures"]} for t in (first, other)]
    assert values[0] == values[1]  # the best model is no draw
    assert {f["name"]: f["value"] for f in alone["figures"]} == values[0]
    assert all(f["low"] is None for f in alone["figures"])
    assert not [name for name in alone["columns"] if name.endswith("_low")]


def test_given_coefficients_take_the_place_of_the_estimate(samples: Path, auvident: Call) -> None:
    text = Path(VEHICLE).read_text()
    given = "\n[coefficients]\nN_uud = { value = -9.0, std = 0.1 }\n"
    Path("v.toml").write_text(text + given)
    base = ("--maneuver", "turning-circle", "--json")
    found = result_of(auvident("simulate", "v.toml", *base))
    assert found["source"] == "given"
    assert found["given"] == ["N_uud"]
    assert "1 coefficients are as given" in found["findings"][-1]["message"]
    before = result_of(auvident("simulate", VEHICLE, *base))
    gain, other = (
        next(f["value"] for f in told["figures"] if f["name"] == "nomoto_gain")
        for told in (found, before)
    )
    assert gain != pytest.approx(other, rel=0.01)


def test_runs_and_models(demo: Path, auvident: Call) -> None:
    """The model of a run, at the speed of its trial; alone at one of its own, which is said."""
    base = ("--maneuver", "zigzag:10/10", "--json")
    found = result_of(auvident("simulate", demo, *base))
    assert found["source"] == "identified"
    assert found["model"].endswith("refine/model.json")
    ase = json.loads((demo / "ase" / "coefficients.json").read_text())
    assert found["speed_mps"] == pytest.approx(ase["speed_mps"], rel=1e-6)
    assert result_of(auvident("simulate", demo / "refine" / "model.json", *base)) == found
    shutil.copy(demo / "refine" / "model.json", "alone.json")
    called = auvident("simulate", "alone.json", *base)
    middle = middle_flown(json.loads(Path("alone.json").read_text())["flown"])
    assert result_of(called)["speed_mps"] == pytest.approx(middle)
    assert f"{middle:.3g} m/s" in called.err and "--speed" in called.err
    assert "--speed" not in auvident("simulate", "alone.json", *base, "--rpm", "900").err
    assert result_of(called)["model"] == "alone.json"


def trial_at(run: Path, speed_mps: float) -> None:
    """A run whose trial was sailed at this speed: not the usual one, nor that of the sample."""
    file = run / "ase" / "coefficients.json"
    file.write_text(json.dumps(json.loads(file.read_text()) | {"speed_mps": speed_mps}))


def middle_flown(flown: dict[str, float]) -> float:
    return 0.5 * (flown["u"] + flown["u_low"])


def test_a_combined_model_flies_at_the_speed_of_its_trial(demo: Path, auvident: Call) -> None:
    """Without the run at one that it was identified at, and at the usual one last: both are said.

    The plane that was estimated has no trial of its own, and takes that of the other.
    """
    trial_at(demo, 1.4)
    assert auvident("combine", demo, "--output", "whole.json").code == 0
    base = ("simulate", "whole.json", "--samples", "0", "--json", "--maneuver")
    for maneuver in ("zigzag:10/10", "vertical-zigzag:10/5"):
        called = auvident(*base, maneuver)
        assert result_of(called)["speed_mps"] == pytest.approx(1.4)
        assert "--speed" not in called.err
    Path("runs").rename("elsewhere")
    tree = json.loads(Path("whole.json").read_text())
    middle = middle_flown(tree["flown"]["horizontal"])
    for speed, words in ((middle, f"{middle:.3g} m/s, the middle"), (1.5, SPEED_ASSUMED)):
        called = auvident(*base, "zigzag:10/10")
        assert result_of(called)["speed_mps"] == pytest.approx(speed)
        assert words in " ".join(called.err.split())
        assert "--speed" not in auvident(*base, "zigzag:10/10", "--speed", "1.3").err
        Path("whole.json").write_text(json.dumps(tree | {"flown": {}}))


def test_a_run_of_another_vehicle_tells_no_speed(demo: Path, auvident: Call) -> None:
    """Where a combined model was taken to, its run may have the name of one that is there."""
    assert auvident("combine", demo, "--output", "whole.json").code == 0
    trial_at(demo, 1.4)
    file = demo / "ase" / "coefficients.json"
    file.write_text(json.dumps(json.loads(file.read_text()) | {"vehicle": "another"}))
    called = auvident("simulate", "whole.json", "--maneuver", "zigzag", "--samples", "0", "--json")
    assert result_of(called)["speed_mps"] != pytest.approx(1.4)
    assert "the middle of those" in " ".join(called.err.split())


class Noted(Observer):
    """Keeps what it is told."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def note(self, text: str) -> None:
        """Keep a line."""
        self.lines.append(text)


def test_a_vehicle_file_is_flown_at_its_design_speed(samples: Path, auvident: Call) -> None:
    """By the command and by the interface; without one at the usual speed, which is said."""
    stated, text = "design_speed_mps = 1.5", Path(VEHICLE).read_text()
    for line, speed, is_said in (("design_speed_mps = 1.9", 1.9, False), ("", 1.5, True)):
        Path("v.toml").write_text(text.replace(stated, line))
        flown = ("simulate", "v.toml", "--maneuver", "zigzag:10/10", "--samples", "0", "--json")
        called, told = auvident(*flown), Noted()
        assert result_of(called)["speed_mps"] == pytest.approx(speed)
        assert (SPEED_ASSUMED in " ".join(called.err.split())) is is_said
        whole = interface.load_whole_model("v.toml").maneuver("zigzag:10/10", 0, observer=told)
        assert whole.result.speed_mps == pytest.approx(speed)
        assert (SPEED_ASSUMED in told.lines) is is_said


def test_a_maneuver_beyond_what_was_flown_says_by_what(demo: Path, auvident: Call) -> None:
    """The trial has 20 deg of rudder; what is estimated from geometry was never flown."""
    near = result_of(auvident("simulate", demo, "--maneuver", "zigzag:10/10", "--json"))
    assert near["extrapolation"] == {}
    called = auvident("simulate", demo, "--maneuver", "turning-circle:30", "--json")
    rudder = result_of(called)["extrapolation"]["rudder"]
    assert np.degrees(rudder["reaches"]) == pytest.approx(30.0)
    assert np.degrees(rudder["identified"]) == pytest.approx(20.0, abs=0.5)
    told = " ".join(called.err.split())
    assert "beyond the maneuvers used for identification: 30 deg of rudder (20 deg there)" in told
    vehicle = ("simulate", "sample_logs/remus100.toml", "--maneuver", "turning-circle:30", "--json")
    assert result_of(auvident(*vehicle))["extrapolation"] == {}


def test_a_run_may_have_a_model_of_each_plane(demo: Path, auvident: Call) -> None:
    """The model of the second plane stands beside the first one's."""
    called = auvident("simulate", demo, "--maneuver", "depth-step:3")
    assert called.code == 4
    assert "vertical plane" in called.err
    assert "--plane vertical" in called.err
    model = demo / "refine" / "model.json"
    called = auvident("simulate", model, "--maneuver", "depth-step:3")
    assert called.code == 3
    assert "vertical plane" in called.err
    beside = demo / "identify" / "vertical" / "model.json"
    beside.parent.mkdir()
    beside.write_text(vertical(model))
    found = result_of(auvident("simulate", demo, "--maneuver", "depth-step:3", "--json"))
    assert found["plane"] == "vertical"
    assert found["model"].endswith("identify/vertical/model.json")
    assert (
        "zigzag"
        in result_of(auvident("simulate", demo, "--maneuver", "zigzag", "--json"))["maneuver"]
    )


def vertical(model: Path) -> str:
    """A model of the vertical plane: that of the horizontal one by the names of the other."""
    found = json.loads(model.read_text())
    names = {"Y": "Z", "N": "M", "v": "w", "r": "q"}
    signs = {"Y_rdot", "N_vdot", "Y_ur", "N_uv", "Y_uud", "X_rr"}
    for row in found["coefficients"]:
        symbol = row["symbol"]
        axis, _, rest = symbol.partition("_")
        if symbol in signs:
            row["value"] *= -1.0
        if axis in "YNX" and symbol not in ("X_udot", "X_uu", "X_uudd"):
            rest = rest if rest.endswith("uud") else "".join(names.get(c, c) for c in rest)
            row["symbol"] = f"{names.get(axis, axis)}_{rest}"
    found |= {"plane": "vertical", "effects": [], "covariance": {}, "flown": {}}
    return json.dumps(found)


@pytest.mark.parametrize(
    ("arguments", "code", "word"),
    [
        ((VEHICLE, "--maneuver", "loop"), 2, "turning-circle:15"),
        ((VEHICLE, "--maneuver", "zigzag:5"), 0, ""),
        ((VEHICLE, "--maneuver", "zigzag:1/1/1"), 2, "2 of them"),
        ((VEHICLE,), 2, "--inputs LOG or --maneuver"),
        ((VEHICLE, "--maneuver", "zigzag", "--inputs", "sample_logs/bay_trial"), 2, "either"),
        (
            (VEHICLE, "--maneuver", "zigzag", "--from", "3"),
            2,
            "--from can only be used with --inputs",
        ),
        (
            (VEHICLE, "--maneuver", "zigzag", "--rate", "50"),
            2,
            "--rate can only be used with --inputs",
        ),
        (
            ("runs/demo", "--inputs", "log", "--rpm", "900"),
            2,
            "--rpm can only be used with --maneuver",
        ),
        ((VEHICLE, "--maneuver", "zigzag", "--figure", "f.pdf"), 2, ".svg or .png"),
        ((VEHICLE, "--maneuver", "zigzag", "--output", "f.txt"), 2, ".csv"),
        ((VEHICLE, "--maneuver", "zigzag", "--speed", "-1"), 2, "--speed"),
        ((VEHICLE, "--maneuver", "depth-step", "--speed", "0.1"), 5, "mass_kg"),
        (("none.json", "--maneuver", "zigzag"), 3, "no such file"),
        (("none.toml", "--maneuver", "zigzag"), 3, "none.toml"),
        (("runs/none", "--maneuver", "zigzag"), 4, "auvident ingest"),
        (("sample_logs/kvlcc2/vehicle.toml", "--maneuver", "depth-step"), 3, "[coefficients]"),
    ],
)
def test_wrong_usage_and_inputs(
    samples: Path, auvident: Call, arguments: tuple[str, ...], code: int, word: str
) -> None:
    called = auvident("simulate", *arguments)
    assert called.code == code, called.err
    assert word in called.err
    assert "Traceback" not in called.err


def test_a_table_of_no_form_is_refused_before_anything_is_flown(
    samples: Path, auvident: Call
) -> None:
    sweep = ("--sweep", "rudder.exposed_span_m=0.08:0.09:2")
    for command in (
        ("simulate", VEHICLE, "--maneuver", "zigzag"),
        ("simulate", VEHICLE, "--inputs", "sample_logs/harbour_trial"),
        ("ase", "--vehicle", VEHICLE, *sweep),
    ):
        called = auvident(*command, "--output", "f.txt")
        assert called.code == 2
        assert called.err.startswith("Error: f.txt: is neither a .parquet nor a .csv file")


def test_the_help_names_every_maneuver_with_its_defaults(auvident: Call) -> None:
    from auvident.schema.desk import MANEUVERS

    text = " ".join(auvident("simulate", "--help").out.split()).replace("- ", "-")
    assert all(row.usual in text for row in MANEUVERS)
    assert "positive to starboard, or bow up" in text
