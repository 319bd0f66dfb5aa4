"""One ingested trial: every sensor on one clock."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pandas as pd


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
