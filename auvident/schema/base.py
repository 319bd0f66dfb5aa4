"""Common ground of every declared file: strict, immutable, finite.

The schema of a class is built when it is first used: a command reads few of them.
"""

import re
from typing import Any

from pydantic import BaseModel, ConfigDict, ValidationInfo, field_validator


class Declared(BaseModel):
    """A table of a file the user writes: unknown keys are refused, numbers are finite."""

    model_config = ConfigDict(
        extra="forbid", frozen=True, allow_inf_nan=False, strict=False, defer_build=True
    )

    @field_validator("*", mode="before")
    @classmethod
    def _no_truth_for_a_number(cls, value: Any, info: ValidationInfo) -> Any:
        """Refuse true where a number is asked for, which pydantic takes for 1."""
        if isinstance(value, bool) and info.field_name is not None:
            asked = repr(cls.model_fields[info.field_name].annotation)
            if re.search(r"\b(float|int)\b", asked) and "bool" not in asked:
                raise ValueError(f"a number is asked for, not {str(value).lower()}")
        return value


class Artifact(BaseModel):
    """A file the program writes: immutable, finite, keys may be added in later versions."""

    model_config = ConfigDict(
        extra="ignore", frozen=True, allow_inf_nan=False, populate_by_name=True, defer_build=True
    )
