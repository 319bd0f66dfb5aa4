"""The ingest stage: which logs are trials, which of them can be used, one report on all of them.

Imports stand inside for speed: a command loads only what it uses.
"""

from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from auvident.errors import AuvidentError, InputError
from auvident.pipeline.given import Given
from auvident.pipeline.naming import named_alike, not_here

if TYPE_CHECKING:
    from auvident.schema.artifacts import Finding
    from auvident.schema.logs import ColumnMap, SetAside, TrialQuality
    from auvident.schema.trial import Trial
    from auvident.schema.vehicle import Vehicle
    from auvident.stages.ingest import Fingerprint
    from auvident.storage.log_find import TrialSource

NAMED_FEW = 5  # paths in one finding


def ingest(given: Given) -> dict[str, Any]:
    """Read the logs and the vehicle file, bring every trial to one clock."""
    from auvident.schema.logs import Quality
    from auvident.stages.ingest import refuse_unproposed, stated_noise_for
    from auvident.storage.declared import outside_allowed
    from auvident.storage.vehicle_file import load_vehicle

    with outside_allowed(bool(given.options.get("allow_outside"))):
        vehicle = load_vehicle(Path(given.options["vehicle"]))
    aside = _Aside(given)
    used: dict[str, _Ingested] = {}
    sources = _trial_sources(given, aside)
    sizes = [_size(source) for source in sources]
    for k, source in enumerate(sources):
        done = sum(sizes[:k]) / max(sum(sizes), 1) if len(sources) > 1 else None
        given.observer.progress(f"reading {source.place}", done)
        with aside.instead_of(source):
            _add(given, vehicle, source, used, aside, alone=len(sources) == 1)
    if not used:
        raise aside.none_left()
    proposed = {name for done in used.values() for name in done.proposed}
    qualities = tuple(done.quality for done in used.values())
    refuse_unproposed(tuple(given.options.get("fix", ())), proposed, qualities)
    outputs: dict[str, Any] = {
        f"ingest/{name}.parquet": done.trial.table for name, done in used.items()
    }
    outputs["ingest/vehicle.json"] = stated_noise_for(vehicle, qualities)
    report = Quality.model_validate(
        {
            "vehicle": vehicle.body.name,
            "rate_hz": given.options["rate_hz"],
            "trials": qualities,
            "findings": (*aside.findings(), *_left_out_findings(given.options)),
            "set_aside": aside.told(),
        }
    )
    outputs["ingest/quality.json"] = named_alike(report, given.options["logs"])
    return outputs


@dataclass(frozen=True)
class _Ingested:
    """A trial in use, what tells whether another one is the same, and corrections it proposes."""

    source: "TrialSource"
    trial: "Trial"
    quality: "TrialQuality"
    fingerprint: "Fingerprint | None"
    proposed: frozenset[str]


def _add(
    given: Given,
    vehicle: "Vehicle",
    source: "TrialSource",
    used: dict[str, _Ingested],
    aside: "_Aside",
    *,
    alone: bool,
) -> None:
    """Read one trial, hold it against the others, bring it to one clock."""
    from auvident.stages.ingest import fingerprint, ingest_fixed, without_copies
    from auvident.storage.logs import read_trial

    raw = read_trial(source, _column_map(given.options))
    _refuse_namesake(raw.name, used)
    own = None if alone else fingerprint(raw)
    parts: tuple[str, ...] = ()
    if own is not None:
        known = [done.fingerprint for done in used.values() if done.fingerprint is not None]
        raw, parts = without_copies(raw, own, known, replaceable=aside.may_lack(used))
    done = ingest_fixed(
        raw,
        vehicle,
        tuple(given.options.get("fix", ())),
        rate_hz=given.options["rate_hz"],
        max_gap_s=given.options["max_gap_s"],
    )
    for name in parts:
        aside.replaced(used.pop(name).source, raw.name)
    used[done.trial.name] = _Ingested(source, done.trial, done.quality, own, done.proposed)


def _size(source: "TrialSource") -> int:
    """Bytes of the files of a trial."""
    return sum(file.stat().st_size for file in source.files if file.is_file())


class _Aside:
    """Trials that cannot be used: raised at once, unless the others do without them."""

    def __init__(self, given: Given) -> None:
        self.given = given
        self.faults: list[tuple[str, AuvidentError]] = []

    def may_fail(self, source: "TrialSource") -> bool:
        """Whether the run goes on without a trial."""
        return source.among_others or bool(self.given.options.get("keep_going"))

    def may_lack(self, used: Mapping[str, _Ingested]) -> frozenset[str]:
        """Names of the trials in use that could give way to another one."""
        return frozenset(name for name, done in used.items() if self.may_fail(done.source))

    @contextmanager
    def instead_of(self, source: "TrialSource") -> Iterator[None]:
        """Note why a trial cannot be used."""
        try:
            yield
        except InputError as error:
            if not self.may_fail(source):
                raise
            self.note(source.name, error)

    def note(self, trial: str, error: AuvidentError) -> None:
        """Set a trial aside."""
        self.given.observer.refused(str(error))
        self.faults.append((trial, error))

    def replaced(self, source: "TrialSource", by: str) -> None:
        """Set a trial aside that is a part of a longer one."""
        problem = f"trial {source.name} is a part of trial {by}, which is used"
        remedy = (
            "Leave it out: what is held out in one would be used for identification in the other."
        )
        self.note(source.name, InputError(problem, str(source.place), remedy))

    def none_left(self) -> AuvidentError:
        """The error when no trial is left, with the reason of each."""
        from auvident.storage.log_find import Fault, none_usable

        return none_usable([Fault(Path(t), e) for t, e in self.faults if isinstance(e, InputError)])

    def findings(self) -> "tuple[Finding, ...]":
        """What leads the findings of the run."""
        from auvident.schema.artifacts import Finding

        return tuple(
            Finding(code="log_refused", message=e.problem, where=e.where, remedy=e.remedy)
            for _, e in self.faults
        )

    def told(self) -> "tuple[SetAside, ...]":
        """The trials and why."""
        from auvident.schema.logs import SetAside

        return tuple(
            SetAside(trial=t, reason=e.problem, where=e.where, remedy=e.remedy)
            for t, e in self.faults
        )


def _trial_sources(given: Given, aside: _Aside) -> "list[TrialSource]":
    """Every trial among the logs; those that are none are noted where the others do without."""
    from auvident.storage.log_find import Fault, find_trials

    column_map = _column_map(given.options)
    found: list[TrialSource] = []
    for group in _groups(given.options):
        faults: list[Fault] = []
        try:
            found += find_trials(group, column_map, faults)
        except InputError as error:
            if not given.options.get("keep_going"):
                raise
            aside.note(group[0].stem, error)
        for fault in faults:
            aside.note(fault.path.stem, fault.error)
    return found


def hindrance(path: Path) -> str:
    """Why a log is refused as it is, or a part of it set aside; empty where all of it is read.

    Parameters
    ----------
    path : Path
        A file, a trial folder or a folder of them; read without a map.
    """
    from auvident.stages.ingest.order import order_rows
    from auvident.storage.log_find import Fault, find_trials
    from auvident.storage.logs import read_trial

    faults: list[Fault] = []
    try:
        for source in find_trials([path], None, faults):
            raw = read_trial(source)
            for sensor in raw.sensors.values():
                order_rows(sensor)
            for finding in (f for f in raw.findings if f.code == "file_set_aside"):
                return str(InputError(finding.message, finding.where, finding.remedy))
    except InputError as error:
        return str(error)
    return str(faults[0].error) if faults else ""


def _groups(options: Mapping[str, Any]) -> list[list[Path]]:
    """All logs together; one by one where one may fail (sensor files belong together)."""
    paths = [not_here(Path(p)) for p in options["logs"]]
    if not options.get("keep_going"):
        return [paths]
    files = [p for p in paths if p.is_file()]
    alone = [[p] for p in paths if not p.is_file()]
    return [*alone, files] if files else alone


def _refuse_namesake(name: str, known: Collection[str]) -> None:
    """Refuse a second trial of one name; logs that are searched one by one may have such."""
    if name in known:
        raise InputError(
            f"two trials are named {name!r}",
            f"trial {name}",
            "Rename one of the files or folders: a trial is named after it.",
        )


def _left_out_findings(options: Mapping[str, Any]) -> "tuple[Finding, ...]":
    """Outputs of this program among the logs, which are none."""
    from auvident.schema.artifacts import Finding
    from auvident.storage.log_own import left_out

    found = left_out([not_here(Path(p)) for p in options["logs"]])
    if not found:
        return ()
    names = ", ".join(str(p) for p in found[:NAMED_FEW])
    names += ", ..." if len(found) > NAMED_FEW else ""
    return (
        Finding(
            code="own_outputs_left_out",
            message=f"{len(found)} outputs of auvident among the logs were skipped",
            where=names,
            value=float(len(found)),
        ),
    )


def _column_map(options: Mapping[str, Any]) -> "ColumnMap | None":
    from auvident.storage.declared import outside_allowed
    from auvident.storage.logs import read_column_map

    with outside_allowed(bool(options.get("allow_outside"))):
        return read_column_map(Path(options["map"])) if options["map"] else None


def ingest_sources(options: Mapping[str, Any]) -> list[Path]:
    """Files of the logs, the map, the vehicle file and its offsets file."""
    from auvident.storage.declared import file_named_in, outside_allowed, read_toml

    vehicle = Path(options["vehicle"])
    sources = [vehicle]
    hull = read_toml(vehicle).get("hull")
    if isinstance(hull, dict) and isinstance(hull.get("offsets"), str):
        with outside_allowed(bool(options.get("allow_outside"))):
            sources.append(file_named_in(vehicle, hull["offsets"], "[hull] offsets"))
    if options["map"]:
        sources.append(Path(options["map"]))
    return list(dict.fromkeys([*sources, *log_files(options)]))


def log_files(options: Mapping[str, Any]) -> list[Path]:
    """Files of the trials among the logs."""
    from auvident.storage.log_find import find_trials

    found: list[Path] = []
    column_map = _column_map(options)
    for group in _groups(options):
        try:
            found += [f for trial in find_trials(group, column_map, []) for f in trial.files]
        except InputError:
            if not options.get("keep_going"):
                raise
    return found
