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
`steady.yaml`, drawn with `--kind spectrum` and `--kind teeth`. Where designs are compared, the mesh stiffness of one
stage varies at a time and the others keep their mean. Root stresses here are static, by ISO 6336-3.""",
    sections={
        "The gearbox and Table II": gearbox.STATEMENTS,
        "Module, pressure angle and contact ratio": design.STATEMENTS,
    },
)
