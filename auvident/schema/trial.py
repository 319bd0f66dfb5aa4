"""One ingested trial: every sensor on one clock."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from auvident.schema.channels import TIME_COLUMN

if TYPE_CHECKING:
    import pandas as pd

TURNED_COLUMN = "turned_rad"  # keeps `Trial.turned_rad` where readings are blanked
# longest gap of the yaw rate over which a heading is summed up: a turn at 10 deg/s that begins or
# ends in it leaves the heading off by 10 deg, as the drift of a gyro does in 20 minutes
LONGEST_UNREAD_S = 2.0


@dataclass(frozen=True)
class Trial:
    """A trial on one clock.

    Attributes
    ----------
    name : str
        Stem of its folder or file.
    table : pandas.DataFrame
        Rows at 1/rate_hz in ascending ``time_s``; the columns of `auvident.schema.channels`
        that the log has, in SI, signs internal; NaN where a gap was too long to bridge; a
        boolean column ``<sensor>_sampled`` per sensor (a real sample stands behind the row; a
        row between two samples of a slower sensor is interpolated and False); an integer column
        ``record`` that rises at each interruption of a needed channel (-1 inside it).
    rate_hz : float
        Rows per second.
    """

    name: str
    table: "pd.DataFrame"
    rate_hz: float

    @cached_property
    def has_heading(self) -> bool:
        """Whether a heading was logged."""
        return "heading_rad" in self.table and bool(self.table["heading_rad"].notna().any())

    def lacking(self, columns: Iterable[str]) -> list[str]:
        """Those of some columns of which there is no value."""
        return [c for c in columns if c not in self.table or not self.table[c].notna().any()]

    @cached_property
    def turned_rad(self) -> npt.NDArray[Any] | None:
        """Heading (n,) since the first row as the gyro has it: the yaw rate summed up.

        A bias of the gyro of 0.01 deg/s turns it by 12 deg in 20 minutes. None without a yaw rate,
        and where it has a gap longer than `LONGEST_UNREAD_S`.
        """
        if TURNED_COLUMN in self.table:
            return self.table[TURNED_COLUMN].to_numpy(dtype=float)
        time_s = self.table[TIME_COLUMN].to_numpy(dtype=float)
        read = np.asarray(self.table.get("r_radps", np.full(len(time_s), np.nan)), dtype=float)
        there = np.isfinite(read)
        if there.sum() < 2 or np.diff(time_s[there]).max() > LONGEST_UNREAD_S:
            return None
        rate = np.interp(time_s, time_s[there], read[there])
        steps = 0.5 * (rate[1:] + rate[:-1]) * np.diff(time_s)
        return np.concatenate([[0.0], np.cumsum(steps)])
