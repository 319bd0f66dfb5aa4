"""Units that the samples do not have: feet, km/h, and labels that nobody knows."""

import numpy as np
import pandas as pd
import pytest
from log_world import sensor_tables, wide_table, write_folder

from auvident.errors import InputError
from auvident.storage.log_inspect import inspect_log
from auvident.storage.logs import read_trials

FOOT_M, KMPH_MPS = 0.3048, 1.0 / 3.6


def written(tmp_path, names, factors):
    """A wide log whose columns have other names and are divided by some factors."""
    table = wide_table()
    for name, factor in factors.items():
        table[name] /= factor
    table.rename(columns=names).to_csv(tmp_path / "wide.csv", index=False)
    return tmp_path / "wide.csv"


@pytest.mark.parametrize(
    ("names", "factor"),
    [
        ({"u_mps": "u [ft/s]", "v_mps": "v [ft/sec]"}, FOOT_M),
        ({"u_mps": "u_ftps", "v_mps": "v_ftps"}, FOOT_M),
        ({"u_mps": "u (km/h)", "v_mps": "v (km/h)"}, KMPH_MPS),
    ],
)
def test_speeds_in_feet_and_kilometres(tmp_path, names, factor):
    (trial,) = read_trials([written(tmp_path, names, dict.fromkeys(names, factor))])
    np.testing.assert_allclose(trial.sensors["dvl"].values["u_mps"], wide_table()["u_mps"])


def test_a_suffix_and_a_label_in_another_unit_are_refused(tmp_path):
    with pytest.raises(InputError, match="u_mps is labelled 'ft/s'"):
        read_trials([written(tmp_path, {"u_mps": "u_mps [ft/s]"}, {})])


def test_an_unknown_label_is_quoted_and_asks_for_its_scale(tmp_path):
    tables = sensor_tables()
    depth = pd.DataFrame({"time_s": tables["dvl"]["time_s"], "depth [dbar]": 5.0})
    folder = write_folder(tmp_path / "run", tables | {"depth": depth})
    with pytest.raises(InputError, match="labelled 'dbar', which is no known unit") as caught:
        read_trials([folder])
    assert 'unit = "m", scale = 0 }' in str(caught.value)
    assert "what 1 dbar is in that unit" in str(caught.value)
    depth = next(
        line for line in inspect_log(folder).proposed_map.splitlines() if "depth =" in line
    )
    assert 'labelled "dbar"; unit guessed' in depth
