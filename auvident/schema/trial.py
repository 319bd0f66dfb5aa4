"""One ingested trial: every sensor on one clock."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from auvident.schema.channels import TIME_COLUMN

if TYPE_CHECKING:
    import pandas as pd

Columns = Mapping[str, npt.NDArray[Any]]  # of a table by name, of one length

TURNED_COLUMN = "turned_rad"  # keeps `Trial.turned_rad` where readings are blanked
# longest gap of the yaw rate over which a heading is summed up: a turn at 10 deg/s that begins or
# ends in it leaves the heading off by 10 deg, as the drift of a gyro does in 20 minutes
LONGEST_UNREAD_S = 2.0


def stacked(pieces: Sequence[Columns]) -> Columns:
    """Tables of the same columns one below the other."""
    return {name: np.concatenate([piece[name] for piece in pieces]) for name in pieces[0]}


@dataclass(frozen=True)
class Trial:
    """A trial on one clock.

    Attributes
    ----------
    name : str
        Stem of its folder or file.
    columns : mapping of str to (n,) array
        Rows at 1/rate_hz in ascending ``time_s``; the columns of `auvident.schema.channels`
        that the log has, in SI, signs internal; NaN where a gap was too long to bridge; a
        boolean column ``<sensor>_sampled`` per sensor (a real sample stands behind the row; a
        row between two samples of a slower sensor is interpolated and False); an integer column
        ``record`` that rises at each interruption of a needed channel (-1 inside it).
    rate_hz : float
        Rows per second.
    """

    name: str
    columns: Columns
    rate_hz: float

    @classmethod
    def from_table(cls, name: str, table: "pd.DataFrame", rate_hz: float) -> "Trial":
        """A trial of a data frame, which is then its `table`."""
        trial = cls(name, {str(c): values.to_numpy() for c, values in table.items()}, rate_hz)
        vars(trial)["table"] = table
        return trial

    def with_table(self, table: "pd.DataFrame") -> "Trial":
        """The same trial with other rows or columns."""
        return Trial.from_table(self.name, table, self.rate_hz)

    def with_columns(self, columns: Columns) -> "Trial":
        """The same trial with some columns changed or added."""
        return replace(self, columns={**self.columns, **columns})

    @cached_property
    def table(self) -> "pd.DataFrame":
        """The columns as a data frame, which shares their memory."""
        import pandas as pd  # a sixth of a second to import, for what works on arrays alone

        return pd.DataFrame(self.columns, copy=False)

    def __len__(self) -> int:
        """Number of rows."""
        return len(self.columns[TIME_COLUMN])

    def has(self, column: str) -> bool:
        """Whether there is a value of a column."""
        return column in self.columns and bool(np.isfinite(self.columns[column]).any())

    def where_known(self, columns: Iterable[str]) -> npt.NDArray[np.bool_]:
        """Rows (n,) in which each of some columns has a value."""
        return np.all([np.isfinite(self.columns[column]) for column in columns], axis=0)

    @cached_property
    def has_heading(self) -> bool:
        """Whether a heading was logged."""
        return self.has("heading_rad")

    def lacking(self, columns: Iterable[str]) -> list[str]:
        """Those of some columns of which there is no value."""
        return [c for c in columns if not self.has(c)]

    @cached_property
    def turned_rad(self) -> npt.NDArray[Any] | None:
        """Heading (n,) since the first row as the gyro has it: the yaw rate summed up.

        A bias of the gyro of 0.01 deg/s turns it by 12 deg in 20 minutes. None without a yaw rate,
        and where it has a gap longer than `LONGEST_UNREAD_S`.
        """
        if TURNED_COLUMN in self.columns:
            return self.columns[TURNED_COLUMN]
        time_s = self.columns[TIME_COLUMN]
        read = self.columns.get("r_radps", np.full(len(time_s), np.nan))
        there = np.isfinite(read)
        if there.sum() < 2 or np.diff(time_s[there]).max() > LONGEST_UNREAD_S:
            return None
        rate = np.interp(time_s, time_s[there], read[there])
        steps = 0.5 * (rate[1:] + rate[:-1]) * np.diff(time_s)
        return np.concatenate([[0.0], np.cumsum(steps)])
