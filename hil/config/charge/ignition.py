"""When a charge is lit, and what that makes of its work."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from hil.config.base import FIXED, Tunable
from hil.config.ranges import PressurePa

LeadS = Annotated[float, Field(ge=0.0, le=0.02)]
Work = Annotated[float, Field(ge=0.0, le=2.0)]
Leads = Annotated[tuple[LeadS, ...], Field(max_length=200, json_schema_extra=FIXED)]
Works = Annotated[tuple[Work, ...], Field(max_length=200, json_schema_extra=FIXED)]


class IgnitionConfig(Tunable):
    """Ignition: how late sparks strike; on the fast models also what catches fire, and its work.

    jitter_s: a spark strikes so much times |z| behind its line's edge, z standard normal
    least_pa: less compressed, a charge does not catch fire; assumed
    work: the same whenever it is lit, or by the map below
    burn_s: duration of a combustion (thesis eq. 3.19), from which the bench makes the map
    lead_s, factor: the map: time from spark to dead centre, and work by that of the planned one;
        the settled stroke's unless given (`hil engine ignition`)
    """

    jitter_s: Annotated[float, Field(ge=0.0, le=0.005)] = 0.0
    least_pa: PressurePa = 2.0e5
    work: Literal["constant", "map"] = Field("constant", json_schema_extra=FIXED)
    burn_s: Annotated[float, Field(gt=0.0, le=0.05, json_schema_extra=FIXED)] = 5.0e-3
    lead_s: Leads = ()
    factor: Works = ()
