"""A gear pair whose mesh stiffness depends on its rotation, with and without the conservation of energy.

Source: Oh, Grosh & Barber, "Energy conserving equations of motion for gear systems", J. Vib. Acoust. 127 (2005).
"""

from gearstab.response.rotating_pair.history import InitialState, PairResponse, respond
from gearstab.response.rotating_pair.integrate import STATUS
from gearstab.response.rotating_pair.stability import held

__all__ = ["STATUS", "InitialState", "PairResponse", "held", "respond"]
