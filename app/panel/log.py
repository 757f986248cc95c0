"""What a panel file says of the operator's log."""

from typing import Annotated

from pydantic import Field

from app.panel.description import Description


class LogRules(Description):
    """`required`: while the log can't be written, nothing can be pressed. The oldest entries go
    after `days`, or when the file is larger than `size_mb` megabytes."""

    enabled: bool = True
    required: bool = True
    days: Annotated[float, Field(gt=0, le=36_500, allow_inf_nan=False)] = 365.0
    size_mb: Annotated[float, Field(ge=8, le=100_000, allow_inf_nan=False)] = 512.0
