"""The statements of Parker, "Vibration of planetary gears with elastically deformable ring gears ..." (2009)."""

from parker_2009 import degenerate, existence, figures, modes, printed
from statements import Paper

PAPER = Paper(
    name="Parker (2009)",
    reference="""\
R. G. Parker, "Vibration of planetary gears with elastically deformable ring gears parametrically excited by mesh
stiffness fluctuations", *ASME IDETC/CIE 2009*, DETC2009-87343.""",
    remarks="""\
The numerical boundaries are those of the gear in the nine modes of Table 1, in phase in the modes of one type at a
time, into which it splits exactly. The ring's inertia is m_r/cos^2 alpha_r, as in the appendix; Table 1 prints it
rounded.""",
    sections={
        "Table 1 and the modes": modes.STATEMENTS,
        "Which instabilities exist": existence.STATEMENTS,
        "Degenerate modes, and what widths depend on": degenerate.STATEMENTS,
        "Widths, Fig. 3 and Fig. 4": figures.STATEMENTS,
        "Operators and identities": printed.STATEMENTS,
    },
)
