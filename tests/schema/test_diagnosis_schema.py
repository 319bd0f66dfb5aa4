"""The printed schema of an artifact has every key that the artifact has."""

import pytest

from auvident.pipeline.schemas import json_schema
from auvident.schema.diagnosis import Comparison, Diagnosis
from tests import loop_world


@pytest.mark.parametrize(
    ("name", "artifact"),
    [
        ("diagnosis", loop_world.diagnosis()),
        ("comparison", loop_world.comparison(loop_world.diagnosis())),
    ],
)
def test_every_key_of_the_artifact_is_in_its_schema(
    name: str, artifact: Diagnosis | Comparison
) -> None:
    schema = json_schema(name)
    assert set(artifact.model_dump(by_alias=True)) <= set(schema["properties"])
    parameter = schema["$defs"]["ParameterValue"]["properties"]
    assert set(artifact.effects[0].parameters[0].model_dump()) == set(parameter)
    assert "interval" in parameter


def test_a_file_of_the_user_may_leave_out_what_has_a_default() -> None:
    assert "signs" in json_schema("vehicle")["properties"]
    assert "fin" not in json_schema("vehicle").get("required", [])
