"""Files to start from, which come with the program."""

from importlib.resources import files


def vehicle_template() -> str:
    """A vehicle file (TOML) with every table and key, and what each means."""
    return (files("auvident") / "templates" / "vehicle.toml").read_text(encoding="utf-8")
