"""Damage: the vehicle file and the map."""

from __future__ import annotations

import re
from pathlib import Path

from seatrial.damage.kind import REFUSED, RIGHT, SAID, Kind, family
from seatrial.damage.log import Log, column, times

SAMPLES = Path(__file__).resolve().parents[2]
VEHICLE, GEOMETRY, MAP = "vehicle file", "numbers of the vehicle file", "map"
HULL_LENGTHS = ("length_m", "diameter_m", "nose_length_m", "tail_length_m", "tail_base_diameter_m")


def of(name: str):
    """Apply: the vehicle file of another vehicle."""

    def apply(log: Log, *_: object) -> None:
        other = (SAMPLES / f"{name}.toml").read_text(encoding="utf-8")
        signs = re.search(r"^\[signs\]\n(?:\w.*\n)*", log.vehicle.read_text(encoding="utf-8"), re.M)
        own = signs.group(0) if signs else ""
        text = re.sub(r"^\[signs\]\n(?:\w.*\n)*", lambda _: own, other, flags=re.M)
        log.vehicle.write_text(text, encoding="utf-8")

    return apply


def scaled(table: str, *keys: str):
    """Apply: numbers times the size."""

    def apply(log: Log, factor: float, _: object) -> None:
        for key in keys:
            log.set_key(table, key, times(factor))

    return apply


def whole_hull(log: Log, factor: float, _: object) -> None:
    """Lengths of the hull, offsets as well, times a factor."""
    scaled("hull", *HULL_LENGTHS)(log, factor, None)


def text(change):
    """Apply: the text of the vehicle file changed."""
    return lambda log, *_: log.edit_vehicle(change)


def without(table: str, key: str):
    """Apply: a key is not there."""
    return lambda log, *_: log.set_key(table, key, None)


def without_table(name: str):
    """The text without a table."""
    return lambda text: re.sub(rf"^\[+{name}\]+\n(?:(?!\[).*\n)*", "", text, flags=re.M)


def mapped(text: str):
    """Apply: a map."""
    return lambda log, *_: log.write_map(text)


def names_lost(log: Log, mapped_back: bool) -> None:
    """Other names in the DVL's file, and a map for them."""
    log.rename("dvl", {"u": "surge", "v": "sway", "w": "heave"})
    if mapped_back:
        log.write_map(
            "\n".join(
                [
                    "[dvl]",
                    *(
                        f'{q} = {{ column = "{n}", unit = "mps" }}'
                        for q, n in (("u", "surge"), ("v", "sway"), ("w", "heave"))
                    ),
                ]
            )
        )


def entry(sensor: str, quantity: str, more: str):
    """Apply: a map of one column."""

    def apply(log: Log, *_: object) -> None:
        name = column(log.read(sensor), quantity)
        log.write_map(f'[{sensor}]\n{quantity} = {{ column = "{name}", {more} }}\n')

    return apply


def exchanged(log: Log, *_: object) -> None:
    """A map that takes v for u."""
    log.write_map(
        '[dvl]\nu = { column = "v_mps", unit = "mps" }\nv = { column = "u_mps", unit = "mps" }\n'
    )


def elevator_for_rudder(log: Log, *_: object) -> None:
    """A map that takes the elevator for the rudder."""
    log.write_map(
        '[rudder]\nfile = "elevator.csv"\nrudder = { column = "elevator_deg", unit = "deg" }\n'
    )


VEHICLE_ROWS = family(
    "vehicle file",
    *(
        Kind(f"vehicle-{n}", VEHICLE, f"the vehicle file of another vehicle ({n})", SAID, of(n))
        for n in ("remus100", "tern180")
    ),
    Kind(
        "length", GEOMETRY, "length and diameter of the hull times {}", SAID, whole_hull, (0.7, 1.5)
    ),
    Kind(
        "length-millimetres",
        GEOMETRY,
        "lengths of the hull in mm",
        REFUSED,
        lambda log, *_: whole_hull(log, 1000.0, None),
    ),
    Kind("mass", GEOMETRY, "mass times {}", SAID, scaled("vehicle", "mass_kg"), (0.5, 2.0)),
    Kind(
        "mass-grams",
        GEOMETRY,
        "mass in grams",
        REFUSED,
        lambda log, *_: scaled("vehicle", "mass_kg")(log, 1000.0, None),
    ),
    Kind(
        "inertia",
        GEOMETRY,
        "moment of inertia times {}",
        SAID,
        scaled("vehicle", "izz_kgm2"),
        (10.0,),
    ),
    Kind(
        "fins-forward",
        GEOMETRY,
        "fins ahead of the origin: x_m with the other sign",
        SAID,
        lambda log, *_: scaled("fin", "x_m")(log, -1.0, None),
    ),
    Kind(
        "fins-span",
        GEOMETRY,
        "span of the fins times {}",
        SAID,
        scaled("fin", "exposed_span_m"),
        (2.0,),
    ),
    Kind("no-fins", GEOMETRY, "no fin in the vehicle file", REFUSED, text(without_table("fin"))),
    Kind(
        "propeller-diameter",
        GEOMETRY,
        "diameter of the propeller times {}",
        SAID,
        scaled("propeller", "diameter_m"),
        (0.5, 2.0),
    ),
    Kind(
        "propeller-curve",
        GEOMETRY,
        "thrust coefficients times {}",
        SAID,
        scaled("propeller", "kt0", "kt1"),
        (3.0,),
    ),
    Kind(
        "no-propeller",
        GEOMETRY,
        "no propeller in the vehicle file",
        SAID,
        text(without_table("propeller")),
    ),
    Kind(
        "dvl-place",
        GEOMETRY,
        "the DVL half a hull length from where it is",
        SAID,
        lambda log, *_: log.set_key(
            "dvl", "x_m", lambda old: repr(float(old) + 0.5 * hull_length(log))
        ),
        (),
        "dvl",
    ),
    Kind(
        "dvl-mounting",
        GEOMETRY,
        "mounting_yaw_deg = {} where there is none",
        SAID,
        lambda log, k, _: log.set_key("dvl", "mounting_yaw_deg", f"{k:.1f}"),
        (20.0,),
        "dvl",
    ),
    Kind(
        "density",
        GEOMETRY,
        "density in g/cm3",
        REFUSED,
        lambda log, *_: log.set_key("fluid", "density_kgpm3", lambda _: "1.025"),
    ),
    Kind(
        "negative-mass",
        VEHICLE,
        "a negative mass",
        REFUSED,
        lambda log, *_: scaled("vehicle", "mass_kg")(log, -1.0, None),
    ),
    Kind("no-mass", VEHICLE, "no mass_kg", REFUSED, without("vehicle", "mass_kg")),
    Kind("no-signs", VEHICLE, "no [signs]", REFUSED, text(without_table("signs"))),
    Kind(
        "misspelt",
        VEHICLE,
        "a key misspelt",
        REFUSED,
        text(lambda t: t.replace("izz_kgm2", "Izz_kgm2")),
    ),
    Kind(
        "number-as-text",
        VEHICLE,
        "a number in quotes",
        REFUSED,
        lambda log, *_: log.set_key("vehicle", "mass_kg", lambda old: f'"{old} kg"'),
    ),
    Kind(
        "decimal-comma-toml",
        VEHICLE,
        "decimal commas in the vehicle file",
        REFUSED,
        text(lambda t: re.sub(r"(\d)\.(\d)", r"\1,\2", t)),
    ),
    Kind(
        "cut-toml",
        VEHICLE,
        "the vehicle file ends early",
        REFUSED,
        text(lambda t: t[: len(t) // 3]),
    ),
    Kind("empty-toml", VEHICLE, "a vehicle file without a byte", REFUSED, text(lambda _: "")),
    Kind(
        "csv-as-vehicle",
        VEHICLE,
        "a log in place of the vehicle file",
        REFUSED,
        lambda log, *_: log.vehicle.write_bytes(log.file("rpm").read_bytes()) and None,
    ),
)

MAP_ROWS = family(
    "map",
    Kind(
        "map-right",
        MAP,
        "other names, and a map for them",
        RIGHT,
        lambda log, *_: names_lost(log, True),
        (),
        "dvl",
    ),
    Kind(
        "map-missing",
        MAP,
        "other names without a map",
        REFUSED,
        lambda log, *_: names_lost(log, False),
        (),
        "dvl",
    ),
    Kind(
        "map-rudder-sign",
        "sign of the rudder",
        "sign = -1 for the rudder",
        REFUSED,
        entry("rudder", "rudder", 'unit = "deg", sign = -1'),
        (),
        "rudder",
    ),
    Kind(
        "map-yaw-rate-sign",
        "sign of the yaw rate",
        "sign = -1 for r",
        REFUSED,
        entry("gyro", "r", "sign = -1"),
        (),
        "gyro",
    ),
    Kind(
        "map-rudder-unit",
        "scale of the rudder",
        'unit = "rad" for degrees',
        REFUSED,
        entry("rudder", "rudder", 'unit = "rad"'),
        (),
        "rudder",
    ),
    Kind(
        "map-knots",
        "scale of the speed",
        'unit = "kn" for m/s',
        SAID,
        entry("dvl", "u", 'unit = "kn"'),
        (),
        "dvl",
    ),
    Kind(
        "map-exchanged",
        "axes of the DVL",
        "u and v exchanged in the map",
        SAID,
        exchanged,
        (),
        "dvl",
    ),
    Kind(
        "map-elevator",
        MAP,
        "the elevator's column as rudder",
        REFUSED,
        elevator_for_rudder,
        (),
        "rudder",
    ),
    Kind(
        "map-no-column",
        MAP,
        "a column that is not there",
        REFUSED,
        mapped('[dvl]\nu = { column = "speed", unit = "mps" }\n'),
        (),
        "dvl",
    ),
    Kind(
        "map-no-file",
        MAP,
        "a file that is not there",
        REFUSED,
        mapped('[dvl]\nfile = "adcp*"\n'),
        (),
        "dvl",
    ),
    Kind("map-misspelt", MAP, "a table misspelt", REFUSED, mapped("[rduder]\nsign = -1\n")),
    Kind(
        "map-wrong-unit",
        MAP,
        "a unit that does not fit",
        REFUSED,
        entry("dvl", "u", 'unit = "deg"'),
        (),
        "dvl",
    ),
    Kind(
        "map-offset",
        "clock of dvl",
        "time_offset_s = {} for the DVL",
        SAID,
        lambda log, s, _: log.write_map(f"[dvl]\ntime_offset_s = {s}\n"),
        (5.0,),
        "dvl",
        figure=True,
    ),
    Kind("map-no-toml", MAP, "a map that is no TOML", REFUSED, mapped("[dvl\nu: v\n")),
    Kind("map-empty", MAP, "a map without a byte", RIGHT, mapped("")),
)


def hull_length(log: Log) -> float:
    """Length that the vehicle file states [m]."""
    found = re.search(r"^length_m = ([\d.e+-]+)", log.vehicle.read_text(encoding="utf-8"), re.M)
    if found is None:
        raise ValueError("the vehicle file states no length")
    return float(found.group(1))
