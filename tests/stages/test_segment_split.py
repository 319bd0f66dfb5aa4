"""One role for each stretch: what goes along with a held-out maneuver, and what does not."""

import pytest

from auvident.errors import UsageError
from auvident.schema.artifacts import Maneuver
from auvident.schema.planes import PLANES
from auvident.stages.segment.split import choose, going_along, share_within, split


def maneuver(name: str, start: float, end: float, kind: str = "straight", **features) -> Maneuver:
    plane = features.pop("plane", "horizontal")
    runs = kind == "straight" and plane == "horizontal"
    return Maneuver(
        id=name,
        trial=features.pop("trial", "t"),
        plane=plane,
        planes=features.pop("planes", PLANES if runs else [plane]),
        kind=kind,
        t_start_s=start,
        t_end_s=end,
        role="identify",
        features=features,
    )


def step(name: str, start: float, end: float, **features) -> Maneuver:
    """A depth step."""
    return maneuver(name, start, end, plane="vertical", maneuver="depth_step", **features)


def roles_of(maneuvers, hold_out=()) -> dict[str, str]:
    return {m.id: m.role for m in split(maneuvers, ["t"], hold_out)[0]}


@pytest.mark.parametrize(
    ("spans", "share"),
    [
        ([(0, 100)], 1.0),
        ([(20, 30)], 0.5),
        ([(20, 30), (25, 35)], 0.75),
        ([(50, 60)], 0.0),
        ([(35, 90), (0, 25)], 0.5),
        ([(22, 24), (20, 40)], 1.0),
    ],
)
def test_share_within_counts_no_time_twice(spans, share) -> None:
    others = [maneuver(f"o{i}", a, b) for i, (a, b) in enumerate(spans)]
    assert share_within(maneuver("m", 20, 40), others) == pytest.approx(share)
    elsewhere = [maneuver("o", a, b, trial="other") for a, b in spans]
    assert share_within(maneuver("m", 20, 40), elsewhere) == 0.0


def test_most_of_a_maneuver_within_a_held_out_one_takes_it_along() -> None:
    some = [maneuver("run", 0, 100), step("inside", 90, 109), step("beside", 97, 130)]
    assert going_along(some, ["run"]) == {"inside": "run"}
    assert going_along(some, ["inside"]) == {}


def test_what_goes_along_takes_along_and_names_what_was_held_out() -> None:
    some = [maneuver("run", 0, 100), step("a", 60, 130), step("b", 105, 125)]
    assert going_along(some, ["run"]) == {"a": "run", "b": "run"}


def test_the_choice_spares_a_run_that_would_take_all_depth_steps_along() -> None:
    """The run with the smallest steps would be held out otherwise."""
    some = [
        maneuver("low", 100, 300, rpm_steps=[100.0]),
        maneuver("middle", 0, 50, rpm_steps=[200.0]),
        maneuver("high", 400, 450, rpm_steps=[300.0]),
    ]
    assert choose(some) == {"low"}
    steps = [step("a", 120, 150), step("b", 200, 240)]
    held = choose([*some, *steps])
    assert "low" not in held
    left = {name for name, role in roles_of([*some, *steps]).items() if role == "identify"}
    assert left & {"a", "b"}
    assert len(held & {"middle", "high"}) == 1


def test_of_runs_in_both_planes_one_is_held_out_where_another_is_left() -> None:
    alone = [maneuver(f"h{i}", 100 * i, 100 * i + 50, planes=["horizontal"]) for i in range(3)]
    both = [maneuver(f"b{i}", 100 * i + 500, 100 * i + 550) for i in range(2)]
    assert choose([*alone, *both]) <= {"b0", "b1"}
    assert choose([*alone, both[0]]) <= {"h0", "h1", "h2"}
    assert len(choose([*alone, both[0]])) == 1


def test_a_user_who_holds_out_all_with_what_goes_along_is_refused() -> None:
    some = [maneuver("run", 0, 100), step("inside", 20, 60)]
    with pytest.raises(UsageError, match="none is left"):
        split(some, ["t"], ["run"])
    assert roles_of(some, ["inside"]) == {"run": "identify", "inside": "validate"}
