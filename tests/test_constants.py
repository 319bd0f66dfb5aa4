"""Constants stand once, and those that ought to grow with the vehicle are marked so."""

import ast
from collections import Counter
from pathlib import Path

from auvident import constants

PACKAGE = Path(constants.__file__).parent
# Times fixed for a vehicle of some metres; those of a ship are 20 to 40 times as long.
SCALE_WITH_THE_VEHICLE = """
ANSWER_S APPROACH_S BLOCK_S BRIDGED_S CIRCLE_S DIVE_WINDOW_S HORIZONS_S INDEPENDENT_S
LEAD_IN_S LEAST_TIME_S
LEVEL_S LONGEST_CORRELATION_S LONG_HOLD_S LONG_RUN_S MAX_PERIOD_S MEAN_WINDOW_S
MIN_COMMON_S NEAR_S OBSERVER_TIMES_S QUICK_S REST_S SETTLED_S SETTLE_S SHORTEST_EDGE_S
SHORTEST_LEVEL_S SHORTEST_PIECE_S SHORTEST_S SHORTEST_TRANSIT_S SLOW_S SMOOTHED_S SMOOTHING_S
START_AFTER_S START_BEFORE_S STEP_REACH_S TIMES_S ZIGZAG_S
"""


def assigned() -> list[tuple[str, ast.Assign | ast.AnnAssign]]:
    """Name and statement of every module-level constant of the package."""
    found: list[tuple[str, ast.Assign | ast.AnnAssign]] = []
    for path in sorted(PACKAGE.rglob("*.py")):
        for node in ast.parse(path.read_text()).body:
            if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
                found.append((node.target.id, node))
            elif isinstance(node, ast.Assign):
                found += [(t.id, node) for t in node.targets if isinstance(t, ast.Name)]
    return found


def test_times_that_scale_with_the_vehicle_are_marked_and_listed() -> None:
    marked = [
        name
        for name, node in assigned()
        if isinstance(node, ast.AnnAssign) and "VehicleTime" in ast.unparse(node.annotation)
    ]
    assert sorted(marked) == sorted(SCALE_WITH_THE_VEHICLE.split())
    assert all(name.endswith("_S") for name in marked)


def test_shared_constants_stand_nowhere_else() -> None:
    shared = {name for name in vars(constants) if name.isupper()}
    times = Counter(name for name, _ in assigned())
    assert shared and all(times[name] == 1 for name in shared)
    numbers = {1.4826, 9.80665, 9.81}
    for path in PACKAGE.rglob("*.py"):
        if path.name != "constants.py":
            tree = ast.walk(ast.parse(path.read_text()))
            assert not numbers & {n.value for n in tree if isinstance(n, ast.Constant)}, path
