"""How people write the units that a log may have, beside the program's own names for them."""

import re

SPELLINGS: dict[str, str] = {
    "m/s": "mps",
    "kt": "kn",
    "kts": "kn",
    "knot": "kn",
    "knots": "kn",
    "cm/s": "cmps",
    "mm/s": "mmps",
    "km/h": "kmph",
    "km/hr": "kmph",
    "kmh": "kmph",
    "kph": "kmph",
    "ft/s": "ftps",
    "fps": "ftps",
    "°": "deg",
    "º": "deg",  # the sign of an ordinal, which keyboards have
    "degree": "deg",
    "degrees": "deg",
    "radian": "rad",
    "radians": "rad",
    "degrees_north": "deg",
    "degree_north": "deg",
    "degrees_east": "deg",
    "degree_east": "deg",
    "rad/s": "radps",
    "deg/s": "degps",
    "dps": "degps",
    "1/min": "rpm",
    "min-1": "rpm",
    "rev/min": "rpm",
    "r/min": "rpm",
    "1/s": "rps",
    "rev/s": "rps",
    "hz": "rps",
    "metre": "m",
    "meter": "m",
    "metres": "m",
    "meters": "m",
    "feet": "ft",
    "foot": "ft",
}
PER_SECOND = re.compile(r"(?P<of>.+?)(?:\s*/\s*s(?:ec|econd)?|[ .·*]?s\^?(?:-1|⁻¹))")


def spelled(text: str) -> str:
    """The program's name of a unit as a header, a units row or a map has it (``[deg/sec]``).

    Parameters
    ----------
    text : str
        With or without brackets, in any case.

    Returns
    -------
    str
        Lower case; what is no known spelling comes back as it is.
    """
    word = text.strip().strip("[]()").strip().lower()
    per_second = PER_SECOND.fullmatch(word)  # deg/sec, m s-1
    if per_second:
        of = per_second["of"]
        word = f"{SPELLINGS.get(of, of)}/s"
    return SPELLINGS.get(word, word)
