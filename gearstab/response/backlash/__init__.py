"""Loss of contact: teeth with backlash that part and meet, followed from event to event."""

from gearstab.response.backlash.dynamics import KINDS
from gearstab.response.backlash.follow import Event
from gearstab.response.backlash.history import (
    BACKLASH_FLAGS,
    BacklashResponse,
    LimitCycle,
    backlash_response,
    has_backlash,
)

__all__ = ["BACKLASH_FLAGS", "KINDS", "BacklashResponse", "Event", "LimitCycle", "backlash_response", "has_backlash"]
