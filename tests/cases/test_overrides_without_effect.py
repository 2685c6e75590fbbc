"""An override of a parameter that the sweep sets anyway is said in one line."""

import pytest
from scenes import ROOT, ran

import gearstab as gs
from gearstab.config import load
from gearstab.errors import DoubtWarning

CASE = ROOT / "tests" / "cases" / "e1_axis_and_set.yaml"
TIE = "{targets: [epsilon, damping_ratio], values: [0.1, 0.2]}"
ALL, SOME = "[{epsilon: 0.1}, {epsilon: 0.2}]", "[{epsilon: 0.1}, {contact_ratio: 1.5}]"


def test_the_axis_wins_and_says_so() -> None:
    found = ran("check", CASE, "--set", "epsilon=0.2")
    assert found.exit_code == 0
    assert found.stderr.splitlines() == [
        "warning: --set epsilon: system.meshes.0.epsilon: has no effect on the sweep, whose axis epsilon sets it "
        "(got 0.2); set sweep.epsilon instead"
    ]
    found = ran("check", CASE, "--set", "sweep.epsilon=[0.2]", "--set", "damping_ratio=0.03")
    assert (found.exit_code, found.stderr) == (0, "")


def test_from_python() -> None:
    with pytest.warns(DoubtWarning, match="override epsilon: .* has no effect on the sweep"):
        gs.load(CASE, epsilon=0.2)


@pytest.mark.parametrize(
    ("axis", "name", "without"),
    [
        (TIE, "epsilon", True),
        (TIE, "damping_ratio", True),
        (TIE, "contact_ratio", False),
        (ALL, "meshes.0.epsilon", True),
        (SOME, "epsilon", False),  # the value of the second case
        (SOME, "contact_ratio", False),
    ],
)
def test_ties_and_cases(axis: str, name: str, without: bool) -> None:
    sweep = f"sweep={{mesh_frequency: [1, 2], together: {axis}}}"
    for overrides in ([sweep, f"{name}=0.05"], [f"{name}=0.05", sweep]):
        if name == "contact_ratio":
            overrides = [text.replace("0.05", "1.3") for text in overrides]
        found = [problem.path for problem in load(CASE, overrides).doubts if problem.code == "set_twice"]
        assert len(found) == without
        assert not found or found[0].endswith(name)


def test_a_section_gives_base_values_as_a_file_does() -> None:
    mesh = "meshes=[{mean_stiffness: 1.0, epsilon: 0.2, contact_ratio: 1.15}]"
    assert load(CASE, [mesh, "sweep.epsilon={start: 0, stop: 0.3, num: 3}"]).doubts == ()
