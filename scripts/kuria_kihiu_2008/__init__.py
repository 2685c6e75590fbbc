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
printed, or assumed. So load factors and stresses are compared in kind and not in digits. Figures 4 to 8 are
`steady.yaml`, drawn with `--kind spectrum` and `--kind teeth`; Figures 9 to 12 and 15 to 17 are stages I and II, or
stage IV, by themselves (`designs/`), drawn by `make figures`; Figures 13 and 14 are `contact_ratio.yaml`. Where
designs are compared in numbers, the mesh stiffness of one stage varies at a time and the others keep their mean. Root
stresses in the table are static, by ISO 6336-3; those of the figures are dynamic.""",
    sections={
        "The gearbox and Table II": gearbox.STATEMENTS,
        "Module, pressure angle and contact ratio": design.STATEMENTS,
    },
)
