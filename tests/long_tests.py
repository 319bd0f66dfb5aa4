"""Tests that take long, and what stands in for them in ``make test``.

``make test`` runs in minutes, ``make test-long`` runs these alone and ``make bench`` begins with
them. A row is a pattern of node ids, from the folder of the tests on; behind it stands what is left
for every change.
"""

import re
from collections.abc import Iterable
from functools import cache

LONG: dict[str, str] = {
    r"test_kvlcc2\.py::test_the_loop_finds_the_propeller": "bench tanker; its model is identified",
    r"test_kvlcc2\.py::test_what_the_loop_found_predicts": "bench tanker; its model is identified",
    r"test_readme\.py::test_the_commands_of_a_page\["
    r"(run-directory|six-degrees-of-freedom|desk-maneuvers|exports|plans|logs|own-log)\.md\]": (
        "other pages, and the tests of these commands"
    ),
    r"test_vertical_diagnosis\.py::.*_are_found_together": "a pitch bias alone",
    r"test_vertical_diagnosis\.py::test_nothing_is_found": "a pitch bias, and nothing beside it",
    r"test_vertical_diagnosis\.py::.*\[(clean|pitch and|dvl and)": "the other log",
    r"test_identify\.py::test_with_the_default_plan_as_well\[.*-ukf\]": "the same with the ekf",
    r"test_identify\.py::test_with_the_default_plan_as_well\[(dive|sound)": "the harbour",
    r"test_identify\.py::test_held_out_maneuvers_are_predicted\[(sound|dive)_trial-ukf\]": (
        "the ekf; the ukf in the harbour"
    ),
    r"test_identify\.py::test_held_out_maneuvers_are_predicted\[sound_trial-ekf\]": "the dive",
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
    r"test_seatrial_population\.py::test_what_the_vehicle_has_of_itself": "bench population",
    r"test_ase_population\.py::test_(drag_is_neither_that|no_deviation_is_far)": "bench geometry",
    r"test_ase_vertical\.py::test_(deviations_on_drawn|both_planes_are_as_uncertain)": "SUBOFF",
    r"test_ase_roll\.py::test_deviations_on_drawn_vehicles": "bench geometry; closed forms",
    r"test_refine_unexplained\.py::test_(it_predicts|its_spread|the_model_has)": "of its parts",
    r"test_cli\.py::test_every_example_works\[auvident refine .*--with-unexpl": "other options",
    r"test_cli\.py::test_every_example_works\[auvident diagnose runs/demo\]": "the README's",
    r"test_diagnosis\.py::test_nothing_is_found_with_the_second": "the harbour",
    r"test_segment_elevator\.py::test_zigzags_of_drawn_vehicles_are_found\[12\]": "other seeds",
    r"test_segment_both\.py::test_.*\[(3(03|07|13|16)|\w+-3(03|07|13))\]": "other seeds",
    r"test_pipeline\.py::test_a_run_in_another_folder": "the same input twice in one folder",
    r"test_run_directory\.py::test_a_first_run_killed_at_every_write": "a later run, and at random",
    r"test_run_directory\.py::test_the_program_killed_at_random": "at every write; bench kills",
    r"test_run_directory\.py::test_killed_at_every_write\[after": "killed before every write",
    r"test_constants_estimated\.py::test_a_wrong_file_costs.*\[(as shipped|two \w+ off|z_G.*)\]": (
        "buoyancy omitted"
    ),
    r"test_both_planes\.py::test_each_plane_predicts_as_well": "bench whole",
    r"test_desk_models\.py::test_published_coefficients_are_flown": "bench published",
    r"test_pool\.py::test_the_claims_of_the_pooled": "bench pool",
    r"test_ingest_elevator\.py::test_a_hull_that_answers_slowly": "a lively one",
    r"test_docs\.py::test_(the_site|the_search|equations_are_drawn)": "links of the pages",
    r"test_constants_estimated\.py::test_on_another_vehicle": "a wrong file of this vehicle",
    r"test_ingest_logs\.py::test_trials_of_one_vehicle.*tern180\]": "the other vehicle",
    r"test_segment_samples\.py::test_fresh_trials\[tern180": "the other vehicle",
    r"test_ingest_checks\.py::test_an_offset_of_the_gyro_is_taken_off\[0": "an offset to port",
    r"test_bench_damage\.py::test_through_the_ingest\[(?!iso)": "bench damage; one of them",
    r"test_cli_names\.py::test_a_name_that_looks_like_markup_is_shown\[:": "the other name",
    r"test_segment_depth\.py::test_empty_rows_of_depth_leave.*\[rows[123]\]": "the first rows",
    r"test_ingest_rudder\.py::test_a_trial_at_sea.*-(waves|a gyro of much noise)\]": (
        "a gyro with a bias, and none of these"
    ),
    r"test_ingest_rudder\.py::test_slow_vehicles.*\[0\.1-.*-[24]\.0\]": "faster and slower ones",
    r"test_ase_spread\.py::test_maneuvers_are_those.*\[0\.5\]": "rudders as the formulas have them",
    r"test_ingest_rudder\.py::test_zigzags_alone_with_clocks.*\[tern180": "the other vehicle",
    r"test_lock\.py::test_two_runs_started_together_on_a_new_directory\[[1-9]": "the first try",
    r"test_bench_effects\.py::test_a_trial_goes_through": "bench effects",
    r"test_bench_written\.py::test_the_loop_on_a_trial": "bench loop",
    r"test_bench\.py::test_a_tiled_log": "bench length",
    r"test_bench\.py::test_a_filter_claims": "bench recovery",
    r"test_bench\.py::test_a_log_is_predicted_by": "bench left-out",
    r"test_instants\.py::test_a_step_that_was_put_elsewhere": "a limit that is found from afar",
    r"test_held_out\.py::test_the_diagnosis_is_the_same": "the refined model, which rests on it",
    r"test_combine_flight\.py::test_held_out_maneuvers_of_a_plane.*horizontal": "the vertical",
    r"test_ingest_clocks\.py::test_a_lag_that_explains_hardly_more.*156": "another vehicle",
    r"test_constants_estimated\.py::test_the_ukf_finds_the_same": "the ekf, and ekf against ukf",
    r"test_constants_estimated\.py::test_the_constants_hold.*\[(two newtons|z_G)": "two percent",
    r"test_vertical_diagnosis\.py::test_a_(dvl_deeper|depth_of_the_dvl)": "what the depth told",
    r"test_seatrial_population\.py::test_a_stated_size_is_held": "bench population",
    r"test_seatrial_vertical\.py::test_a_push_changes_heave": "a push in sway and yaw",
    r"test_pool\.py::test_all_trials_see_more": "bench pool; one trial pooled is itself",
    r"test_refine\.py::test_what_holds_in_no_maneuver_is_seldom": "how often its interval holds",
    r"test_unknown_forces\.py::test_forces_are_recovered.*\[1-1": "other seeds",
    r"test_innovations\.py::test_two_series_that_have": "a late answer, and a constant input",
    r"test_agreement\.py::test_the_problem_is_as_hard.*\[(effects|vertical)-ukf": "the ekf",
    r"test_cli_names\.py::test_a_name_that_looks_like_markup_is_shown\[\[/dev": "another name",
}
# of each row: the files it is about, and the tests in them
_ROWS = [
    (row, re.compile(row.split("::")[0] + "$"), re.compile(row.split("::")[1])) for row in LONG
]


@cache
def _rows_of(file: str) -> tuple[re.Pattern[str], ...]:
    return tuple(test for _, files, test in _ROWS if files.search(file))


def is_long(node_id: str) -> bool:
    """Whether a test is one of these."""
    file, _, test = node_id.partition("::")
    return any(pattern.match(test) for pattern in _rows_of(file))


def unknown(node_ids: Iterable[str]) -> list[str]:
    """Rows that no test has."""
    names = [node_id.partition("::") for node_id in node_ids]
    return [
        row
        for row, files, pattern in _ROWS
        if not any(pattern.match(test) and files.search(file) for file, _, test in names)
    ]
