"""Plan files: which plan a name means, and plans that continue a built-in one."""

from pathlib import Path

import pytest

from auvident.errors import InputError
from auvident.storage.plan_file import PLANS, plan_files, plan_path, read_plan

STAGE = """
[[stage]]
name = "more"
system = "surge"
free = ["drag"]
"""


def written(folder: Path, text: str) -> Path:
    path = folder / "mine.toml"
    path.write_text(f'name = "mine"\n{text}')
    return path


def test_a_name_is_that_of_a_built_in_plan_unless_a_file_has_it(tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert plan_path("spiral") == PLANS / "spiral.toml"
    Path("spiral").write_text("")
    assert plan_path("spiral") == Path("spiral")


def test_an_unknown_name_is_refused_with_the_known_ones() -> None:
    with pytest.raises(InputError, match="no such plan") as caught:
        read_plan("spirol")
    assert "abkowitz, coloured, likely, refined, spiral, together" in caught.value.remedy


def test_stages_of_the_plan_it_continues_go_before(tmp_path) -> None:
    spiral, mine = read_plan("spiral"), read_plan(written(tmp_path, 'continues = "spiral"' + STAGE))
    assert [s.name for s in mine.stage] == [*(s.name for s in spiral.stage), "more"]
    assert mine.name == "mine"
    assert (mine.cycles, mine.nuisance) == (spiral.cycles, spiral.nuisance)


def test_its_own_keys_go_before_those_of_the_plan_it_continues(tmp_path) -> None:
    mine = read_plan(written(tmp_path, 'continues = "spiral"\ncycles = 7\nnuisance = []'))
    assert (mine.cycles, mine.nuisance) == (7, ())
    assert mine.stage == read_plan("spiral").stage


def test_both_files_count(tmp_path) -> None:
    mine = written(tmp_path, 'continues = "spiral"')
    assert plan_files(mine) == [mine, PLANS / "spiral.toml"]
    assert plan_files("spiral") == [PLANS / "spiral.toml"]


@pytest.mark.parametrize(
    "name", ['"mine"', '"refined"', '"../plans/spirol"', '"../plans/spiral"', "3", '["a"]']
)
def test_only_a_built_in_plan_that_stands_for_itself_is_continued(tmp_path, name) -> None:
    with pytest.raises(InputError, match="continues") as caught:
        read_plan(written(tmp_path, f"continues = {name}"))
    assert caught.value.remedy == "A plan may continue one of abkowitz, spiral, together."


def test_stages_that_are_no_tables_are_refused(tmp_path) -> None:
    with pytest.raises(InputError, match=r"\[stage\]"):
        read_plan(written(tmp_path, 'continues = "spiral"\nstage = 3'))


def test_a_stage_that_is_written_as_a_table_says_how(tmp_path):
    (tmp_path / "p.toml").write_text('name = "p"\n[stage]\nname = "surge"\nfree = ["X_uu"]\n')
    with pytest.raises(InputError, match=r"write \[\[stage\]\]"):
        read_plan(tmp_path / "p.toml")
