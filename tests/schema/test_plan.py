"""Plan files: the built-in ones, and what a plan may not say."""

from pathlib import Path

import pytest
from pydantic import ValidationError

import auvident
from auvident.schema.coefficients import ESTIMATED, PLANES, constants_of, expand, symbols_of
from auvident.schema.plan import ACTIVE, Plan, PlanStage, Tuning
from auvident.storage.plan_file import read_plan

PLANS = sorted((Path(auvident.__file__).parent / "plans").glob("*.toml"))
STAGE = {"name": "one", "system": "coupled", "free": ["all"]}


def plan(**changes) -> Plan:
    return Plan.model_validate({"name": "test", "stage": [STAGE]} | changes)


def built_in(path: Path) -> Plan:
    return read_plan(path)


def test_there_are_built_in_plans() -> None:
    assert {p.stem for p in PLANS} >= {"spiral", "together", "refined"}


@pytest.mark.parametrize("path", PLANS, ids=lambda p: p.stem)
def test_built_in_plans_have_their_file_name_and_say_what_they_do(path) -> None:
    found = built_in(path)
    assert found.name == path.stem
    assert len(found.description) > 40


@pytest.mark.parametrize("plane", PLANES)
@pytest.mark.parametrize("path", PLANS, ids=lambda p: p.stem)
def test_built_in_plans_estimate_every_coefficient_of_both_planes(path, plane) -> None:
    found = built_in(path)
    freed = {symbol for stage in found.stage for symbol in expand(stage.free, plane)}
    assert freed == {*symbols_of(plane), *constants_of(plane)}


@pytest.mark.parametrize("plane", PLANES)
@pytest.mark.parametrize("path", PLANS, ids=lambda p: p.stem)
def test_built_in_stages_free_only_what_moves_their_states(path, plane) -> None:
    """A coefficient of an equation that a system does not integrate cannot be estimated there."""
    equations = {"surge": "XT", "lateral": "YNZM", "coupled": "XTYNZM"}
    for stage in built_in(path).stage:
        freed = [ESTIMATED[symbol] for symbol in expand(stage.free, plane)]
        axes = {"T" if c.group == "thrust" else c.equation for c in freed}
        assert axes, stage.name
        assert axes <= set(equations[stage.system]), stage.name


@pytest.mark.parametrize("path", PLANS, ids=lambda p: p.stem)
def test_the_last_stage_estimates_everything_from_every_maneuver(path) -> None:
    last = built_in(path).rounds()[-1][1]
    assert last.free == ("all",)
    assert last.system == "coupled"
    assert set(last.maneuvers) == {"straight", "turn", "zigzag"}


def test_stages_go_round_and_those_marked_once_run_at_the_end() -> None:
    stages = [STAGE | {"name": "a"}, STAGE | {"name": "b", "once": True}, STAGE | {"name": "c"}]
    order = [(cycle, stage.name) for cycle, stage in plan(cycles=3, stage=stages).rounds()]
    assert order == [(1, "a"), (1, "c"), (2, "a"), (2, "c"), (3, "a"), (3, "b"), (3, "c")]


def test_systems_estimate_what_they_say() -> None:
    assert ACTIVE["surge"] == (True, False, False)
    assert ACTIVE["lateral"] == (False, True, True)
    assert ACTIVE["coupled"] == (True, True, True)


WRONG = {
    "free": ({"stage": [STAGE | {"free": ["lift", "Y_uvv"]}]}, "Y_uvv"),
    "tuning": ({"tuning": {"N_v": {"prior": 2.0}}}, "N_v"),
    "system": ({"stage": [STAGE | {"system": "roll"}]}, "system"),
    "kind": ({"stage": [STAGE | {"maneuvers": ["spiral"]}]}, "maneuvers"),
    "method": ({"stage": [STAGE | {"method": "guess"}]}, "method"),
    "key": ({"stage": [STAGE | {"fre": ["all"]}]}, "fre"),
    "no stage": ({"stage": []}, "stage"),
    "cycles": ({"cycles": 0}, "cycles"),
    "observer time": ({"observer_time_s": 0.0}, "observer_time_s"),
    "infinite": ({"observer_time_s": float("inf")}, "observer_time_s"),
    "prior": ({"tuning": {"lift": {"prior": 0.0}}}, "prior"),
    "drift": ({"tuning": {"lift": {"drift": -1.0}}}, "drift"),
}


@pytest.mark.parametrize("name", WRONG)
def test_wrong_plans_are_refused_by_name(name) -> None:
    changes, named = WRONG[name]
    with pytest.raises(ValidationError, match=named):
        plan(**changes)


def test_groups_symbols_and_all_are_accepted() -> None:
    stage = PlanStage(name="a", system="surge", free=("all", "lift", "Y_v|v|"))
    assert stage.free == ("all", "lift", "Y_v|v|")
    assert (
        plan(tuning={"lift": Tuning(prior=2.0), "X_uu": {"drift": 0.1}}).tuning["lift"].drift == 0
    )


def test_a_plan_does_not_change() -> None:
    with pytest.raises(ValidationError, match="frozen"):
        plan().cycles = 2


def test_a_stage_of_several_passes_runs_them_in_a_row() -> None:
    first = {"name": "a", "system": "surge", "free": ["drag"], "passes": 2}
    last = {"name": "b", "system": "coupled", "free": ["all"], "once": True, "passes": 3}
    order = [(c, stage.name) for c, stage in plan(cycles=2, stage=[first, last]).rounds()]
    assert order == [(1, "a")] * 2 + [(2, "a")] * 2 + [(2, "b")] * 3
