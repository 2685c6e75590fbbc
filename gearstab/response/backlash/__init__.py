"""Loss of contact: teeth with backlash that part and meet, followed from event to event."""

from gearstab.response.backlash.contact import KINDS
from gearstab.response.backlash.follow import Event
from gearstab.response.backlash.history import BACKLASH_FLAGS, BacklashResponse, backlash_response, has_backlash
from gearstab.response.backlash.measure import LimitCycle

__all__ = ["BACKLASH_FLAGS", "KINDS", "BacklashResponse", "Event", "LimitCycle", "backlash_response", "has_backlash"]
