"""Certificates of matrices: true ones are proved, false ones never are, multipliers agree with every proved claim."""

from __future__ import annotations

import ast
from dataclasses import replace
from functools import cache, partial
from inspect import getsource

import numpy as np
import pytest
from scipy.linalg import expm

pytest.importorskip("flint")

from gearstab.certificates import balls, choices, circle, counting, equations, lyapunov, proof, verifier
from gearstab.certificates.balls import near
from gearstab.certificates.covering import FIRST, by_a_form, claimed, covered
from gearstab.certificates.equations import Flow, Segments, flow
from gearstab.certificates.verifier import Certificate, proves

GYROSCOPIC = np.array([[0.0, -1.0], [1.0, 0.0]])


def segments(
    stiffness: list[np.ndarray],
    fractions: list[float],
    damping: np.ndarray | None = None,
    mass: np.ndarray | None = None,
    rigid: np.ndarray | None = None,
) -> Segments:
    n = len(stiffness[0])
    drag = np.zeros((n, n)) if damping is None else damping
    return Segments(
        np.eye(n) if mass is None else mass, np.array([drag] * len(stiffness)), np.array(stiffness),
        range(len(stiffness)), fractions, 1.0, np.zeros((n, 0)) if rigid is None else rigid,
    )  # fmt: skip


def meissner(epsilon: float = 0.3, damping: float = 0.0) -> Segments:
    """x'' + 2 d x' + (1 +- epsilon) x = 0, half a period each."""
    return segments([np.array([[1 + epsilon]]), np.array([[1 - epsilon]])], [0.5, 0.5], np.array([[2 * damping]]))


def train(epsilon: float = 0.3, damping: float = 0.02) -> Segments:
    """Lin & Parker's three gears, damped in proportion to stiffness."""
    g = np.array([[1.0, -1.0, 0.0], [0.0, 1.0, 1.0]])
    base = np.diag([0.5, 0.0, 0.0])
    levels = [1 + epsilon, 1 - epsilon]
    k = [base + sum(level * np.outer(row, row) for row in g) for level in levels]
    return segments(k, [0.5, 0.5], damping * (base + g.T @ g), np.diag([1.0, 0.3, 4.0]))


def rotor(damping: float = 0.0, speed: float = 0.4) -> Segments:
    """A shaft in rotating coordinates, of which one stiffness varies: M q'' + (C + 2 W G) q' + (K - W^2) q = 0."""
    k = [np.diag([1.0 + e, 1.4]) - speed**2 * np.eye(2) for e in (0.3, -0.3)]
    return segments(k, [0.4, 0.6], damping * np.eye(2) + 2 * speed * GYROSCOPIC)


def turning(damping: float = 0.0, drag: float = 0.0, ratio: float = 0.2) -> Segments:
    """The shaft with W = 0.2 Omega, where a part of the damping turns with it."""
    still = rotor(damping + drag, 0.0)
    return replace(still, following=(2 * ratio * GYROSCOPIC, -drag * ratio * GYROSCOPIC, -(ratio**2) * np.eye(2)))


def at(system: Segments, omega: float) -> Segments:
    """A system at the speed that it has at one mesh frequency."""
    if system.following is None:
        return system
    g, h, k = system.following
    stiffness = system.stiffness + omega * h + omega**2 * k
    return replace(system, damping=system.damping + omega * g, stiffness=stiffness, following=None)


def free(damping: np.ndarray | None = None) -> Segments:
    """Three rotors in a row, free to rotate."""
    k = [np.array([[a, -a, 0.0], [-a, a + 0.7, -0.7], [0.0, -0.7, 0.7]]) for a in (1.3, 0.7)]
    return segments(k, [0.5, 0.5], damping, np.diag([1.0, 0.5, 2.0]), np.ones((3, 1)))


SYSTEMS = {
    "meissner": meissner(), "damped meissner": meissner(damping=0.02), "train": train(),
    "undamped train": train(damping=0.0), "rotor": rotor(), "damped rotor": rotor(0.02), "turning": turning(),
    "turning, damped": turning(0.02), "turning, damped by what turns": turning(0.01, 0.03), "free": free(),
    "free, damped between": free(0.02 * free().stiffness[0]),
    "free, damped to ground": free(0.05 * np.eye(3)),
}  # fmt: skip


CALM = (
    "damped rotor",
    "turning, damped",
    "turning, damped by what turns",
    "free, damped between",
    "free, damped to ground",
)
"""Without growth in this range."""


def multipliers(known: Flow, omega: float) -> np.ndarray:
    """Moduli, by an exponential in floating point."""
    product = np.eye(known.generators[0].nrows())
    for state, f in zip(known.states, known.fractions, strict=True):
        product = expm(near(known.generators[state]) * f * 2 * np.pi * known.cycles / omega) @ product
    return np.sort(np.abs(np.linalg.eigvals(product)))[::-1]


@cache
def pieces_of(name: str) -> tuple[Flow, tuple[Certificate, ...]]:
    known = flow(SYSTEMS[name])
    return known, tuple(covered(1.2, 2.6, 1e-4, partial(by_a_form, known), FIRST))


@pytest.mark.parametrize("name", SYSTEMS)
def test_nearly_the_whole_range_is_proved_and_multipliers_agree(name: str) -> None:
    pieces = pieces_of(name)[1]
    length = sum(np.log(piece.high / piece.low) for piece in pieces)
    assert length > 0.99 * np.log(2.6 / 1.2)
    assert {piece.outside > 0 for piece in pieces} >= ({False} if name in CALM else {False, True})
    for piece in pieces:
        for omega in np.linspace(piece.low, piece.high, 3):
            outside = int((multipliers(flow(at(SYSTEMS[name], omega)), omega) > 1 + 1e-9).sum())
            assert (outside > 0) == (piece.outside > 0)


def edge(epsilon: float, low: float, high: float) -> float:
    """Where the trace of Meissner's equation, in closed form, is -2."""

    def excess(omega: float) -> float:
        a, b = (np.sqrt(1 + sign * epsilon) for sign in (1, -1))
        x, y = a * np.pi / omega, b * np.pi / omega
        return 2 * np.cos(x) * np.cos(y) - (a / b + b / a) * np.sin(x) * np.sin(y) + 2

    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if (excess(middle) > 0) == (excess(low) > 0) else (low, middle)
    return low


def test_pieces_end_at_the_edge_that_is_known_in_closed_form() -> None:
    known, where = flow(meissner()), edge(0.3, 1.6, 1.95)
    for sign, outside in ((-1, 0), (1, 1)):
        near_end, far = where * (1 + 1e-5 * sign), where * (1 + 2e-5 * sign)
        piece = claimed(known, min(near_end, far), max(near_end, far))
        assert piece is not None
        assert piece.outside == outside
        assert proves(known, piece)
        # Over the edge by a hundred-thousandth no coordinates prove it.
        moved = (where * (1 - 1e-5), far) if sign > 0 else (far, where * (1 + 1e-5))
        assert not proves(known, replace(piece, low=moved[0], high=moved[1]))


FORGERS = ("moved over an edge", "other claim", "coordinates of another piece", "not a number", "malformed")


@pytest.mark.parametrize("number", range(50))
def test_a_forged_certificate_is_refused(number: int) -> None:
    random = np.random.default_rng(number)
    name = ("train", "undamped train", "rotor", "damped meissner", "meissner")[number // 5 % 5]
    known, pieces = pieces_of(name)
    changes = [k for k in range(1, len(pieces)) if (pieces[k].outside > 0) != (pieces[k - 1].outside > 0)]
    k = int(random.choice(changes))
    before, after = pieces[k - 1], pieces[k]
    kind = FORGERS[number % 5]
    if kind == "moved over an edge":
        low, high = after.low * (1 - 1e-3), after.high * (1 - 1e-3)
        forged = replace(before, high=after.low * (1 + 1e-3)) if number % 2 else replace(after, low=low, high=high)
    elif kind == "other claim":
        stable = replace(after, outside=0, rate=float(random.integers(2)))
        forged = stable if after.outside else replace(after, outside=int(random.integers(1, 3)), rate=1.0)
    elif kind == "coordinates of another piece":
        others = [piece for piece in pieces if piece.outside != after.outside]
        far = max(others, key=lambda piece: abs(np.log(piece.low / after.low)))
        forged = replace(after, coordinates=far.coordinates, rate=far.rate, separators=far.separators)
    elif kind == "not a number":
        spoiled = after.coordinates.copy()
        spoiled[tuple(random.integers(len(spoiled), size=2))] = np.nan
        forged = replace(after, coordinates=spoiled) if random.integers(2) else replace(after, high=np.nan)
    else:
        smaller, singular = after.coordinates[:-1], np.ones_like(after.coordinates)
        forged = replace(after, coordinates=smaller if random.integers(2) else singular)
    assert not proves(known, forged)


def test_a_claim_at_another_speed_proves_nothing() -> None:
    """By what turns with it the shaft grows by itself at twice the speed: no claim of decay holds for it."""
    slow = flow(turning(0.01, 0.3))
    fast = turning(0.01, 0.3, 1.0)
    piece = next(covered(2.0, 2.1, 1e-4, partial(by_a_form, slow)))
    assert piece.outside == 0
    assert proves(slow, piece)
    assert multipliers(flow(at(fast, 2.0)), 2.0)[0] > 1.01
    assert not proves(flow(fast), piece)
    grows = next(covered(2.0, 2.1, 1e-4, partial(by_a_form, flow(fast))))
    assert grows.outside > 0
    assert not proves(slow, grows)


def test_a_rate_on_the_wrong_side_of_one_proves_nothing() -> None:
    """Growth by more than a factor below 1 is no growth, decay to less than a factor above 1 no decay."""
    known, pieces = pieces_of("train")
    stable, unstable = (next(p for p in pieces if (p.outside > 0) == grows) for grows in (False, True))
    assert not proves(known, replace(stable, rate=1.01))
    assert not proves(known, replace(unstable, rate=0.99))
    assert not proves(known, replace(stable, outside=1, rate=0.5))


def test_a_system_with_damping_keeps_no_form() -> None:
    known, pieces = pieces_of("undamped train")
    piece = next(p for p in pieces if p.outside == 0)
    assert proves(known, piece)
    assert not proves(flow(train(damping=1e-6)), piece)


def test_vectors_that_are_no_rigid_body_modes_are_refused() -> None:
    with pytest.raises(ValueError, match="no rigid-body modes"):
        flow(replace(free(), rigid=np.array([[1.0], [1.0], [1.001]])))


def test_rigid_body_modes_leave_the_elastic_multipliers() -> None:
    """Against the whole matrices, whose multipliers 1 belong to the rigid-body mode."""
    whole, held = replace(free(), rigid=np.zeros((3, 0))), free(0.05 * np.eye(3))
    for system, known, ones in ((whole, flow(free()), 2), (replace(held, rigid=np.zeros((3, 0))), flow(held), 1)):
        every, elastic = multipliers(flow(system), 1.9), multipliers(known, 1.9)
        assert len(every) == len(elastic) + ones
        # A double multiplier 1 of a defective matrix is off by the root of rounding.
        nearest = np.argsort(np.abs(every - 1))[:ones] if ones == 1 else np.argsort(np.abs(every - 1))[:2]
        np.testing.assert_allclose(np.delete(every, nearest), elastic, rtol=1e-6)


def test_what_follows_the_speed_must_leave_rigid_body_modes_alone() -> None:
    drag, no = 0.1 * np.eye(3), np.zeros((3, 3))
    assert flow(replace(free(), following=(drag, no, no))).generators[0].nrows() == 5
    with pytest.raises(ValueError, match="no rigid-body modes"):
        flow(replace(free(), following=(no, no, drag)))


KINDS = ast.Import | ast.ImportFrom


@pytest.mark.parametrize("number", range(20))
def test_any_choice_of_coordinates_proves_nothing_false(number: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Coordinates between segments by chance: a true claim may fail, a false one does."""
    random = np.random.default_rng(number)
    chosen = [random.standard_normal((6, 6)) for _ in range(2)]
    monkeypatch.setattr(verifier, "coordinates", lambda *_: chosen)
    known, pieces = pieces_of("train")
    piece = pieces[int(random.integers(len(pieces)))]
    other = replace(piece, outside=1, rate=1.0) if piece.outside == 0 else replace(piece, outside=0, rate=1.0)
    assert not proves(known, other)


def test_a_referee_reads_two_hundred_lines() -> None:
    assert len(getsource(verifier).splitlines()) <= 200


def test_the_proof_imports_nothing_of_the_program() -> None:
    """The verifier needs python-flint, NumPy, a chooser of coordinates and polynomials of matrices; what makes its
    matrices the verifier.
    """
    library = {
        "__future__",
        "collections.abc",
        "dataclasses",
        "fractions",
        "functools",
        "itertools",
        "math",
        "numpy",
        "flint",
        "scipy.linalg",
        "typing",
    }
    names = ("choices", "balls", "equations", "verifier", "lyapunov", "counting", "circle")
    choosing, algebra, matrices, proving, falling, numbers, deciding = (f"gearstab.certificates.{n}" for n in names)
    table = (
        (choices, set()), (balls, set()), (circle, set()), (equations, {choosing, algebra}),
        (verifier, {choosing, algebra, matrices}),
        (counting, {choosing, algebra, matrices, deciding}),
        (lyapunov, {choosing, algebra, matrices}), (proof, {numbers, falling, matrices, proving}),
    )  # fmt: skip
    for module, allowed in table:
        nodes = [node for node in ast.walk(ast.parse(getsource(module))) if isinstance(node, KINDS)]
        names = {node.module if isinstance(node, ast.ImportFrom) else node.names[0].name for node in nodes}
        assert {name for name in names if name.startswith("gearstab")} <= allowed
        assert names <= library | allowed


def test_a_long_period_in_which_much_decays_is_proved() -> None:
    """Floquet vectors of its multipliers, which differ by twelve orders of magnitude, are lost in rounding."""
    random = np.random.default_rng(1)
    stiffness = [np.diag([1.0, 400.0]) * (1 + 0.05 * random.standard_normal()) + 0.01 for _ in range(40)]
    known = flow(segments(stiffness, random.dirichlet(np.ones(40)).tolist(), np.diag([0.02, 0.4])))
    assert multipliers(known, 0.05)[0] / multipliers(known, 0.05)[-1] > 1e8
    piece = claimed(known, 0.05, 0.05 * 1.001)
    assert piece is not None
    assert proves(known, piece)
    assert not proves(known, replace(piece, outside=1))


def test_a_common_period_of_thousands_of_segments_is_proved() -> None:
    """Lin & Parker's train with 997 cycles of one mesh and 1009 of the other, 4010 segments, by 1.6 % of speed."""
    marks = np.array([(k + part) / cycles for cycles in (997, 1009) for k in range(cycles) for part in (0.0, 0.5)])
    edges = np.append(np.unique(marks), 1.0)
    middles = 0.5 * (edges[1:] + edges[:-1])
    levels = [np.where(middles * cycles % 1.0 < 0.5, 1.2, 0.8) for cycles in (997, 1009)]
    g = np.array([[1.0, -1.0, 0.0], [0.0, 1.0, 1.0]])
    stiffness = [
        np.diag([0.5, 0.0, 0.0]) + g.T @ np.diag(k) @ g for k in ((1.2, 1.2), (1.2, 0.8), (0.8, 1.2), (0.8, 0.8))
    ]
    base = segments(stiffness, [0.25] * 4, 0.03 * (np.diag([0.5, 0.0, 0.0]) + g.T @ g), np.diag([1.0, 0.3, 4.0]))
    states = (2 * (levels[0] < 1) + (levels[1] < 1)).tolist()
    known = flow(replace(base, states=states, fractions=np.diff(edges).tolist(), cycles=997.0))
    assert len(known.states) > 4000
    (piece,) = covered(2.5, 2.51, 1e-4, partial(by_a_form, known))
    assert (piece.low, piece.high, piece.outside) == (2.5, 2.51, 0)
    for omega in (2.5, 2.51):
        assert multipliers(known, omega)[0] < 1
    assert not proves(known, replace(piece, outside=1))


def test_a_piece_without_end_is_refused_at_once() -> None:
    known, pieces = pieces_of("train")
    assert not proves(known, replace(pieces[0], low=1e-300))
    assert not proves(known, replace(pieces[0], high=1e300))
