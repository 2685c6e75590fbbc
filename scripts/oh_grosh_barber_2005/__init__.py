"""The statements of Oh, Grosh & Barber, "Energy conserving equations of motion for gear systems" (2005)."""

from oh_grosh_barber_2005 import energies, spectra
from statements import Paper

PAPER = Paper(
    name="Oh, Grosh & Barber (2005)",
    reference="""\
S. Oh, K. Grosh and J. R. Barber, "Energy conserving equations of motion for gear systems", *Journal of Vibration and
Acoustics* 127 (2005), 208-212.""",
    remarks="""\
The paper gives neither the torque nor the initial data. Where nothing else is said T0 = 21.05 N m (phi_s = T0/k0 =
0.01) is taken, and the gears begin at theta = 0 under the static deflection T0/k1. The damping acts in (2) and, which
the paper leaves out, in (3): only so does it never give energy.""",
    sections={
        "2 The equations, and 3.1 the energy": energies.STATEMENTS,
        "3.2 The response": spectra.STATEMENTS,
    },
)
