"""The model as an FMU: FMI 2.0 for co-simulation, around the C form.

An FMU is a ZIP file with a description of its variables, a shared library and its source. What is
in it comes from here; compiling and packing is done where files are written. The source is one
file and declares what it needs of FMI itself, so that any C99 compiler builds it without headers.
"""

import hashlib
import re
from dataclasses import dataclass
from xml.etree import ElementTree as ET

from auvident import __version__
from auvident.schema.artifacts import IdentifiedModel
from auvident.schema.planes import BY_PLANE
from auvident.schema.quoting import comment
from auvident.stages.export.c import as_c
from auvident.stages.export.contents import EARLY, Contents, contents_of, remarks, title
from auvident.stages.export.fmu_source import PARTS
from auvident.stages.export.template import assembled, filled

SOURCE = "auvident_fmu.c"
STEP_S = 0.1  # longest step of the integration; a longer one of the master is divided
STOP_S = 60.0  # of the default experiment
MOST_NAME = 40  # characters of a vehicle's name in that of the library
UNITS = {  # of FMI: exponents of base units, factor
    "m": {"m": "1"},
    "m/s": {"m": "1", "s": "-1"},
    "rad": {"rad": "1"},
    "rad/s": {"rad": "1", "s": "-1"},
    "rev/s": {"rad": "1", "s": "-1", "factor": "6.283185307179586"},
    "s": {"s": "1"},
}
PLACES = {
    "horizontal": (("north_m", "north"), ("east_m", "east")),
    "vertical": (("ahead_m", "way ahead over ground"), ("depth_m", "depth")),
}
ORDERED = {
    "rudder": "rudder as ordered; positive: trailing edge to port, the bow turns to port",
    "elevator": "elevator as ordered; positive: trailing edge down, the bow goes down",
}
SHOWN = {  # inputs that other parts of a simulation know, where an effect needs them
    "roll_rad": "roll",
    "pitch_rad": "pitch",
}
FROM_LOG = {  # what the vehicle knows itself, unless a log is followed
    "speed_mps": "surge velocity as logged, for the thrust that meets the fin",
    "depth_m": "depth as logged",
}
UNIT_OF = (("_radps", "rad/s"), ("_mps", "m/s"), ("_rad", "rad"), ("_rps", "rev/s"), ("_m", "m"))


@dataclass(frozen=True)
class FmuVariable:
    """A variable of the FMU; its place in the table is its value reference."""

    name: str
    causality: str
    words: str
    start: float | bool = 0.0

    @property
    def unit(self) -> str:
        """By the end of its name."""
        ends = (unit for ending, unit in UNIT_OF if self.name.endswith(ending))
        return next(ends, "s")

    @property
    def is_flag(self) -> bool:
        """Whether it is true or false."""
        return isinstance(self.start, bool)


def fmu_files(model: IdentifiedModel) -> dict[str, bytes]:
    """Files of the FMU by their path in it, but for the library.

    Raises
    ------
    UsageError
        See `contents_of`.
    """
    contents = contents_of(model)
    table = variables(contents)
    draft = _description(contents, table, "")
    source = _source(contents, table)
    guid = "{" + _guid(draft + source.encode()) + "}"
    return {
        "modelDescription.xml": _description(contents, table, guid),
        f"sources/{SOURCE}": source.replace("@guid@", guid).encode(),
    }


def library_name(model: IdentifiedModel) -> str:
    """Name of the library, a C identifier: of the vehicle and of the plane."""
    plain = re.sub(r"[^A-Za-z0-9]+", "_", model.vehicle).strip("_").lower()[:MOST_NAME]
    return f"auvident_{plain}_{model.plane}" if plain else f"auvident_{model.plane}"


def variables(contents: Contents) -> tuple[FmuVariable, ...]:
    """Variables in the order of their value references: numbers, then what is true or false."""
    row = BY_PLANE[contents.model.plane]
    ordered = (*(ORDERED[fin] for fin in row.fins), "propeller rate as ordered")
    shown = [name for name in SHOWN if name in contents.logged]
    logged = [name for name in FROM_LOG if name in contents.logged]
    outputs = [(s.column, f"{s.words}, through the water") for s in row.states[:2]]
    outputs += [(s.column, s.words) for s in row.states[2:]]
    outputs += PLACES[row.name]
    numbers = [FmuVariable(n, "input", w) for n, w in zip(contents.inputs, ordered, strict=True)]
    numbers += [FmuVariable(n, "input", SHOWN[n]) for n in shown]
    numbers += [FmuVariable(f"log_{n}", "input", FROM_LOG[n]) for n in logged]
    numbers += [FmuVariable(f"initial_{n}", "parameter", f"at the start: {w}") for n, w in outputs]
    numbers += [FmuVariable(n, "parameter", w) for n, w in _surroundings(contents)]
    numbers += [FmuVariable(n, "output", w) for n, w in outputs]
    flags = [FmuVariable("fin_given", "parameter", _FIN_GIVEN, False)]
    flags += [FmuVariable("log_given", "parameter", _LOG_GIVEN, False)] if logged else []
    return (*numbers, *flags)


_FIN_GIVEN = "whether initial_fin_rad is meant; else the servo stands where it is ordered first"
_LOG_GIVEN = "whether the inputs log_ are followed; else the vehicle's own speed and depth"


def _surroundings(contents: Contents) -> list[tuple[str, str]]:
    """Parameters of the environment and of what was before the start."""
    model = contents.model
    found = [("initial_fin_rad", "angle of the servo at the start, where it is given")]
    if "timed" in contents.features:
        found.append(("elapsed_s", "time of the start since the start of the trial"))
    identified = dict(zip(("north", "east", "down"), contents.water.get("WATER", ()), strict=False))
    told = {n: f"; {value:.4g} as identified, zero by default" for n, value in identified.items()}
    names = ("north", "east") if model.plane == "horizontal" else ("north", "east", "down")
    found += [(f"water_{n}_mps", f"velocity of the water, {n}{told.get(n, '')}") for n in names]
    if model.plane == "vertical":
        found.append(("course_rad", "heading, for the velocity of the water"))
    return found


def _source(contents: Contents, table: tuple[FmuVariable, ...]) -> str:
    """C source of the library; its GUID comes last."""
    features = {*contents.features, *contents.logged}
    features |= {"logs"} if any(v.name == "log_given" for v in table) else set()
    numbers = [v for v in table if not v.is_flag]
    flags = [v for v in table if v.is_flag]
    names = [f"    {v.name.upper()}" for v in numbers] + ["    NUMBERS"]
    flagged = [f"    {v.name.upper()}" for v in flags] + ["    FLAGS"]
    row = BY_PLANE[contents.model.plane]
    own = contents.inputs
    values = {
        "numbers": ",\n".join(names),
        "flags": ",\n".join(flagged),
        "states": ", ".join(f"INITIAL_{s.column.upper()}" for s in row.states),
        "outputs": ", ".join(s.column.upper() for s in row.states),
        "places": ", ".join(f"INITIAL_{n.upper()}" for n, _ in PLACES[row.name]),
        "shown": ", ".join(n.upper() for n, _ in PLACES[row.name]),
        "inputs": ", ".join(f"f->number[{name.upper()}]" for name in own),
        "columns": str(len(contents.acting)),
        "step": repr(STEP_S),
        "guid": "@guid@",
    }
    return as_c(contents.model) + filled(assembled(PARTS, features), features, values)


def _description(contents: Contents, table: tuple[FmuVariable, ...], guid: str) -> bytes:
    """``modelDescription.xml``."""
    model = contents.model
    root = ET.Element(
        "fmiModelDescription",
        fmiVersion="2.0",
        modelName=f"{comment(model.vehicle)}, {model.plane} plane",
        guid=guid,
        description=" ".join((title(model, comment), *remarks_of(model))),
        generationTool=f"auvident {__version__}",
        variableNamingConvention="flat",
    )
    running = ET.SubElement(
        root,
        "CoSimulation",
        modelIdentifier=library_name(model),
        canHandleVariableCommunicationStepSize="true",
        canNotUseMemoryManagementFunctions="true",
        canGetAndSetFMUstate="true",
    )
    ET.SubElement(ET.SubElement(running, "SourceFiles"), "File", name=SOURCE)
    units = ET.SubElement(root, "UnitDefinitions")
    for name in sorted({v.unit for v in table if not v.is_flag}):
        ET.SubElement(ET.SubElement(units, "Unit", name=name), "BaseUnit", UNITS[name])
    ET.SubElement(
        root, "DefaultExperiment", startTime="0.0", stopTime=repr(STOP_S), stepSize=repr(STEP_S)
    )
    _describe_variables(root, table)
    ET.indent(root)
    return ET.tostring(root, encoding="UTF-8", xml_declaration=True) + b"\n"


def _describe_variables(root: ET.Element, table: tuple[FmuVariable, ...]) -> None:
    """The variables, and which of them are outputs."""
    listed = ET.SubElement(root, "ModelVariables")
    structure = ET.SubElement(root, "ModelStructure")
    outputs = ET.SubElement(structure, "Outputs")
    unknown = ET.SubElement(structure, "InitialUnknowns")
    references = {True: 0, False: 0}
    for index, v in enumerate(table, start=1):
        kind = {"causality": v.causality, "description": v.words}
        kind |= {"variability": "fixed" if v.causality == "parameter" else "continuous"}
        kind |= {"initial": "exact"} if v.causality == "parameter" else {}
        kind |= {"initial": "calculated"} if v.causality == "output" else {}
        reference = str(references[v.is_flag])
        references[v.is_flag] += 1
        named = {"name": v.name, "valueReference": reference}
        entry = ET.SubElement(listed, "ScalarVariable", named | kind)
        if v.is_flag:
            ET.SubElement(entry, "Boolean", start="false")
            continue
        start = {} if v.causality == "output" else {"start": "0.0"}
        ET.SubElement(entry, "Real", {"unit": v.unit} | start)
        if v.causality == "output":
            ET.SubElement(outputs, "Unknown", index=str(index))
            ET.SubElement(unknown, "Unknown", index=str(index))


def remarks_of(model: IdentifiedModel) -> tuple[str, ...]:
    """What an FMU leaves out beside what every program does."""
    contents = contents_of(model)
    found = list(remarks(model))
    if "DRIFT" in contents.water:
        found.append("Left out, as parameters of an FMU are constant: current_drift.")
    if contents.actuation.get("FIN_DELAY_S", 0.0) < 0.0:
        found.append(EARLY.format("the fin"))
    return tuple(found)


def _guid(content: bytes) -> str:
    digest = hashlib.sha256(content).hexdigest()
    return "-".join((digest[:8], digest[8:12], digest[12:16], digest[16:20], digest[20:32]))
