"""Common ground of every declared file: strict, immutable, finite."""

from pydantic import BaseModel, ConfigDict


class Declared(BaseModel):
    """A table of a file the user writes: unknown keys are refused, numbers are finite."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, strict=False)


class Artifact(BaseModel):
    """A file the program writes: immutable, finite, keys may be added in later versions."""

    model_config = ConfigDict(
        extra="ignore", frozen=True, allow_inf_nan=False, populate_by_name=True
    )
