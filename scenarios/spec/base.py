"""What all parts of a scenario share."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

Metres3 = tuple[float, float, float]
Metres2 = tuple[float, float]
Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]


class Spec(BaseModel):
    """Common rules: no unknown keys, no changes, no NaN."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, ser_json_inf_nan="constants")
