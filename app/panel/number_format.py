"""Keys about how a number is written: its format, and the factor to the unit that is shown."""

from typing import Annotated, Final

from pydantic import Field

# [+] [,] [.digits] [f, e, g, % or d]: the part of Python's format language that can't fail.
FORMAT: Final = r"^\+?,?(\.[0-9]{1,2}[feg%]|[feg%d])$"

Factor = Annotated[float, Field(allow_inf_nan=False)]
