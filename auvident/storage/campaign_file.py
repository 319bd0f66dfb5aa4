"""The campaign file, and the trials that it (or a folder) means."""

import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from auvident.errors import InputError, UsageError
from auvident.schema.campaign import Campaign, CampaignVehicle, RunOptions
from auvident.schema.quoting import clipped
from auvident.storage.declared import file_named_in, fitting, parse, read_toml, refuse_outside
from auvident.storage.log_file import stem
from auvident.storage.log_find import Fault, find_trials
from auvident.storage.log_own import is_run_directory
from auvident.storage.logs import read_column_map
from auvident.storage.plan_file import read_plan
from auvident.storage.vehicle_file import load_vehicle

REMEDY = "`auvident schema campaign` lists the tables and keys."
VEHICLE, CAMPAIGN = "vehicle.toml", "campaign.toml"  # of a folder
NAMED_FOLDERS = 5  # in a message
# in the output of a campaign, beside the folders of its vehicles
RESULT, PAGE = "campaign.json", "campaign.html"
TABLES = ("trials", "coefficients", "effects")  # each a .parquet file
POOLED, CHANGES = "pooled.json", "changes.json"  # of a vehicle, beside the runs of its trials
OF_CAMPAIGN = {RESULT, PAGE, *(f"{name}.parquet" for name in TABLES)}
OF_VEHICLE = {"hull", "fin", "signs"}  # tables that stand in a vehicle file alone
FOLDERS = "Give folders of trials, or a campaign file."
WITH_FOLDERS = f"{FOLDERS[:-1]}; a vehicle file goes with --vehicle."
TRIALS = 'Give folders of trials, e.g. trials = ["2026-05/*"].'


@dataclass(frozen=True)
class PlannedTrial:
    """A trial to run: its vehicle, name and log, the files it is read with, its options."""

    vehicle: str
    name: str
    log: Path
    vehicle_file: Path
    column_map: Path | None
    options: RunOptions


def read_campaign(path: Path, output: Path | None = None) -> tuple[Campaign, list[PlannedTrial]]:
    """A campaign file and its trials, in the order of vehicles and names.

    Parameters
    ----------
    path : Path
    output : Path, optional
        Folder of the results, which is no trial where it stands among the logs.

    Raises
    ------
    InputError
        Missing or unreadable file, unknown key, a pattern that no trial fits; a fault in a file
        of vehicle, map or plan, with which no trial could be run.
    """
    tree = read_toml(path)
    if tree.keys() & OF_VEHICLE:
        raise InputError("is a vehicle file, not a campaign file", str(path), WITH_FOLDERS)
    campaign = parse(Campaign, tree, path, REMEDY)
    trials = [t for v in campaign.vehicle for t in _of_vehicle(v, campaign.run, path, output)]
    return campaign, trials


def _of_vehicle(
    vehicle: CampaignVehicle, common: RunOptions, path: Path, output: Path | None
) -> list[PlannedTrial]:
    where = f"vehicle {vehicle.name}"
    file = file_named_in(path, vehicle.file, f"{where}: file")
    column_map = file_named_in(path, vehicle.map, f"{where}: map") if vehicle.map else None
    refuse_outside({f"{where}: trials": pattern for pattern in vehicle.trials}, path)
    logs = [log for one in vehicle.trials for log in _matching(path, one, where, output)]
    options = _with_plan(vehicle.run or common, path)
    return _planned(vehicle.name, logs, file, column_map, options)


def _with_plan(options: RunOptions, path: Path) -> RunOptions:
    """Options with the file of their plan, which stands beside the campaign file, if it is one.

    Raises
    ------
    InputError
        No such plan, or a fault in it: no trial could be run by it.
    """
    if options.plan is None:
        return options
    plan = options.plan
    if Path(plan).suffix or (path.parent / plan).is_file():
        plan = str(file_named_in(path, plan, "[run] plan"))
    read_plan(plan)
    return options.model_copy(update={"plan": plan})


def _matching(path: Path, pattern: str, where: str, output: Path | None) -> list[Path]:
    """Logs that a pattern means; hidden ones, results and what is no log are left out."""
    place = f"{path}: {where}: trials"
    fit = fitting(pattern, path.parent, place, '"2026-05/*"')
    found = [p for p in fit if not p.name.startswith(".")]
    if not found:
        raise InputError(f"no log fits {clipped(pattern)!r}", place, TRIALS)
    several = any(mark in pattern for mark in "*?[")
    return [p for p in found if not several or _may_be_log(p, output)]


def _may_be_log(path: Path, output: Path | None) -> bool:
    """Whether what a pattern fits is taken for a log: no text beside the logs, no results."""
    if not path.is_dir():
        return path.suffix not in (".toml", ".md")
    if output is not None and path.resolve() == output.resolve():
        return False
    return not is_run_directory(path) and not (path / RESULT).is_file()


def trials_in_folders(
    folders: Sequence[Path], vehicle_file: Path | None, options: RunOptions
) -> list[PlannedTrial]:
    """Trials of folders, one vehicle each: that of the command, else ``vehicle.toml`` in it.

    Raises
    ------
    InputError
        A folder without a vehicle file or without a trial.
    """
    found: list[PlannedTrial] = []
    for folder in folders:
        if not folder.is_dir():
            what = "is no folder of trials" if folder.exists() else "no such folder"
            raise InputError(what, str(folder), FOLDERS)
        file = vehicle_file or folder / VEHICLE
        if not file.exists():
            raise InputError(f"there is no {VEHICLE}", str(folder), _instead_of(folder))
        wrong: list[Fault] = []  # what is no trial is run as well: its row says why
        logs = [s.place for s in find_trials([folder], faults=wrong)]
        logs += [fault.path for fault in wrong]
        name = folder.resolve().name
        if any(t.vehicle == name for t in found):
            raise UsageError(f"two folders are named {name}", str(folder), "Rename one of them.")
        found += _planned(name, sorted(set(logs)), file, None, options)
    return found


def _instead_of(folder: Path) -> str:
    """What to give in place of a folder without a vehicle file."""
    file = folder / CAMPAIGN
    below = sorted(p.parent for p in folder.glob(f"*/{VEHICLE}"))
    named = [shlex.quote(str(place)) for place in below[:NAMED_FOLDERS]]
    more = ", ..." * (len(below) > NAMED_FOLDERS)
    ways = [f"the campaign file {shlex.quote(str(file))}"] if file.is_file() else []
    ways += [f"the folders that have one: {', '.join(named)}{more}"] if named else []
    if not ways:
        return "Put it there, or give --vehicle V.toml."
    return f"Give {', or '.join(ways)}{'' if more else '.'}"


def _planned(
    vehicle: str,
    logs: Sequence[Path],
    file: Path,
    column_map: Path | None,
    options: RunOptions,
) -> list[PlannedTrial]:
    _refuse_taken("vehicle", vehicle, OF_CAMPAIGN, file)
    load_vehicle(file)  # a fault in it, or in the map, is told once and not by every trial
    if column_map is not None:
        read_column_map(column_map)
    names: dict[str, Path] = {}
    for log in dict.fromkeys(logs):
        name = stem(log) if log.is_file() else log.name
        if name in names:
            raise InputError(
                f"two trials of {vehicle} are named {name}", f"{names[name]}, {log}", "Rename one."
            )
        _refuse_taken("trial", name, {POOLED, CHANGES}, log)
        names[name] = log
    return [PlannedTrial(vehicle, n, log, file, column_map, options) for n, log in names.items()]


def _refuse_taken(what: str, name: str, files: set[str], where: Path) -> None:
    """Refuse a name whose folder would stand where the campaign writes a file."""
    if name.casefold() in files:  # some file systems do not tell large letters from small ones
        raise InputError(
            f"the {what} is named {name}, as a file of the results is", str(where), "Rename it."
        )
