"""What a panel file says of recordings."""

from typing import Annotated

from pydantic import Field

from app.panel.description import Description, Topic


class RecordRules(Description):
    """Around each press what was received is recorded, from `before_s` before it to `after_s` after
    it. `topics` are some of those that the panel listens to, None for all. The oldest files go when
    the folder is larger than `max_mb` megabytes."""

    before_s: Annotated[float, Field(ge=0, le=600, allow_inf_nan=False)] = 10.0
    after_s: Annotated[float, Field(ge=0, le=600, allow_inf_nan=False)] = 10.0
    max_mb: Annotated[float, Field(ge=16, le=1_000_000, allow_inf_nan=False)] = 512.0
    topics: Annotated[tuple[Topic, ...] | None, Field(strict=False)] = None
