"""The statements of Lin & Parker, "Mesh stiffness variation instabilities in two-stage gear systems" (2002)."""

from lin_parker_2002 import equations, example, four_gears, three_gears, unequal, wave
from statements import Paper

PAPER = Paper(
    name="Lin & Parker (2002)",
    reference="""\
J. Lin and R. G. Parker, "Mesh stiffness variation instabilities in two-stage gear systems", *Journal of Vibration and
Acoustics* 124 (2002), 68-76.""",
    remarks="""\
The figures carry no numbers beside their axes, so statements are checked, not curves. The results of Tordion & Gauvin
(1977) in Fig. 8 are not checked: the paper does not give their equations.""",
    sections={
        "2 The model, and 3 the equations": equations.STATEMENTS,
        "2 The wave, and 3.1 three gears, equal stiffness variations": [*wave.STATEMENTS, *three_gears.STATEMENTS],
        "3.2 Four gears": four_gears.STATEMENTS,
        "3.3 Unequal stiffness variations": unequal.STATEMENTS,
        "4 The example, and 5 the discussion": example.STATEMENTS,
    },
)
