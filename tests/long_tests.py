"""Tests that take long, and what stands in for them in ``make test``.

``make test`` runs in minutes, ``make test-long`` runs these alone and ``make bench`` begins with
them. A row is a pattern of node ids, from the folder of the tests on; behind it stands what is left
for every change.
"""

import re
from collections.abc import Iterable

LONG: dict[str, str] = {
    r"test_kvlcc2\.py::test_the_loop_finds_the_propeller": "bench tanker; its model is identified",
    r"test_kvlcc2\.py::test_what_the_loop_found_predicts": "bench tanker; its model is identified",
    r"test_readme\.py::test_the_commands_of_a_page\[("
    r"run-directory|six-degrees-of-freedom|desk-maneuvers|exports|plans)\.md\]": "other pages, "
    "and the tests of these commands",
    r"test_vertical_diagnosis\.py::test_a_pitched_dvl": "a pitch bias with an elevator offset",
    r"test_vertical_diagnosis\.py::.*\[dvl and delay\]": "the other logs",
    r"test_identify\.py::test_with_the_default_plan_as_well\[.*-ukf\]": "the same with the ekf",
    r"test_identify\.py::test_held_out_maneuvers_are_predicted\[sound_trial-ukf\]": "the ekf",
    r"test_identify\.py::test_priors_off_by_half.*\[trial[23]-": "priors all down, all up",
    r"test_ingest_rudder\.py::test_a_trial_at_sea_shows_the_sign\[\w+-(circles|zigzags)-": "those "
    "of both maneuvers",
    r"test_seatrial_effects\.py::test_a_drawn_size_still_leaves_a_sea_trial\[.*tern180": "the "
    "other vehicle",
    r"test_seatrial_vertical\.py::test_an_effect_is_visible_by_its_size\[elevator_offset": "those "
    "of a pitch bias and a late depth",
    r"test_seatrial_population\.py::test_an_effect_is_visible_by_its_size\[gyro_bias": "other "
    "effects",
    r"test_seatrial_plant\.py::test_damping_takes_energy.*\[tern180": "the other vehicle",
    r"test_ase_population\.py::test_drag_is_neither_that": "bench geometry; two vehicles by hand",
    r"test_ase_roll\.py::test_deviations_on_drawn_vehicles": "bench geometry; closed forms",
    r"test_refine_unexplained\.py::test_it_predicts_a_force": "the tests of its parts",
    r"test_cli\.py::test_every_example_works\[auvident refine .*--with-unexpl": "other options",
    r"test_diagnosis\.py::test_nothing_is_found_with_the_second": "the harbour and the dive",
    r"test_segment_elevator\.py::test_zigzags_of_drawn_vehicles_are_found\[12\]": "other seeds",
    r"test_constants_estimated\.py::test_the_ukf_finds_the_same": "the ekf, and ekf against ukf",
}
_PATTERNS = [re.compile(pattern) for pattern in LONG]


def is_long(node_id: str) -> bool:
    """Whether a test is one of these."""
    return any(p.search(node_id) for p in _PATTERNS)


def unknown(node_ids: Iterable[str]) -> list[str]:
    """Patterns that no test has."""
    names = list(node_ids)
    return [p.pattern for p in _PATTERNS if not any(p.search(name) for name in names)]
