"""The statements of Kuria & Kihiu, "Modeling parametric vibration of multistage gear systems ..." (2008)."""

from kuria_kihiu_2008 import design, gearbox
from statements import Paper

PAPER = Paper(
    name="Kuria & Kihiu (2008)",
    reference="""\
J. Kuria and J. Kihiu, "Modeling parametric vibration of multistage gear systems as a tool for design optimization",
*Open Science Index, Mechanical and Mechatronics Engineering* 2, no. 2 (2008), publications.waset.org/1259.""",
    remarks="""\
The paper prints few inputs: `configs/kuria_kihiu_2008/gearbox.yaml` marks every number as given, inferred from what is
printed, or assumed. So load factors and stresses are compared in kind and not in digits. `make figures` draws Figures 4
to 8 from `steady.yaml` and, with and without friction, from `friction.yaml`; Figures 9 to 17 from stages I and II, or
stage IV, by themselves (`designs/`). `contact_ratio.yaml` has the contact ratios between those of Figures 13 to 16.
Where designs are compared in numbers, the mesh stiffness of one stage varies at a time and the others keep their mean.
Root stresses in the table are static, by ISO 6336-3; those of the figures are dynamic.""",
    sections={
        "The gearbox and Table II": gearbox.STATEMENTS,
        "Module, pressure angle and contact ratio": design.STATEMENTS,
    },
)
