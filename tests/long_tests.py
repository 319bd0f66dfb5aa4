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
    r"test_readme\.py::test_the_commands_of_a_page\["
    r"(run-directory|six-degrees-of-freedom|desk-maneuvers|exports|plans|logs|own-log)\.md\]": (
        "other pages, and the tests of these commands"
    ),
    r"test_vertical_diagnosis\.py::test_a_pitched_dvl": "a pitch bias with an elevator offset",
    r"test_vertical_diagnosis\.py::test_nothing_is_found": "these two, and no effect beside them",
    r"test_vertical_diagnosis\.py::.*\[(clean|dvl and delay)\]": "the other log",
    r"test_identify\.py::test_with_the_default_plan_as_well\[.*-ukf\]": "the same with the ekf",
    r"test_identify\.py::test_with_the_default_plan_as_well\[(dive|sound)": "the harbour",
    r"test_identify\.py::test_held_out_maneuvers_are_predicted\[(sound|dive)_trial-ukf\]": (
        "the ekf; the ukf in the harbour"
    ),
    r"test_identify_shared\.py::test_both_engines_take": "each by itself, and their agreement",
    r"test_identify\.py::test_priors_off_by_half.*\[trial[1-3]-": "priors all down, all up",
    r"test_ingest_rudder\.py::test_a_trial_at_sea_shows_the_sign\[\w+-(circles|zigzags)-": (
        "those of both maneuvers"
    ),
    r"test_ingest_rudder\.py::test_a_trial_at_sea_shows_the_sign\[tern180-both-": (
        "the other vehicle"
    ),
    r"test_seatrial_effects\.py::test_a_drawn_size_still_leaves_a_sea_trial": (
        "each effect changes the log, of a given size"
    ),
    r"test_seatrial_effects\.py::test_a_current_that_changes": "a steady current",
    r"test_seatrial_\w+\.py::(?!test_steady_speed).*tern180\]": "the other vehicle",
    r"test_seatrial_\w+\.py::test_an_effect_is_visible_by_its_size": "bench population",
    r"test_seatrial_\w+\.py::test_following_the_record": "bench population",
    r"test_seatrial_\w+\.py::test_an_event_does_not_make_another": "bench population",
    r"test_ase_population\.py::test_drag_is_neither_that": "bench geometry; two vehicles by hand",
    r"test_ase_roll\.py::test_deviations_on_drawn_vehicles": "bench geometry; closed forms",
    r"test_refine_unexplained\.py::test_it_predicts_a_force": "the tests of its parts",
    r"test_cli\.py::test_every_example_works\[auvident refine .*--with-unexpl": "other options",
    r"test_cli\.py::test_every_example_works\[auvident diagnose runs/demo\]": "the README's",
    r"test_diagnosis\.py::test_nothing_is_found_with_the_second": "the harbour",
    r"test_segment_elevator\.py::test_zigzags_of_drawn_vehicles_are_found\[12\]": "other seeds",
    r"test_segment_both\.py::test_a_stretch_that_both_searches.*\[3(03|13|16)\]": "other seeds",
    r"test_pipeline\.py::test_a_run_in_another_folder": "the same input twice in one folder",
    r"test_run_directory\.py::test_a_first_run_killed_at_every_write": "a later run, and at random",
    r"test_lock\.py::test_two_runs_started_together_on_a_new_directory\[[1-9]": "the first try",
    r"test_bench_effects\.py::test_a_trial_goes_through": "bench effects",
    r"test_bench_written\.py::test_the_loop_on_a_trial": "bench loop",
    r"test_bench\.py::test_a_tiled_log": "bench length",
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
