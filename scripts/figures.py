"""Every figure of ``configs/``: compute, draw, say how long it takes, and compare with the stored references.

python scripts/figures.py [NAME...]            computes and draws into results/ and results/figures/ what is out of date
python scripts/figures.py --check [NAME...]    and compares with tests/data/figures/
python scripts/figures.py --update [NAME...]   and writes the references anew; `git diff` then shows what changed

NAME is a configuration without its ending, ``lin_parker_2002/fig3``, or a folder of them. ``--within 120`` takes the
quickest figures that need no more than 120 seconds of processor time together, by the times stored with the references.

References lie beside the other numbers of the tests: they are data of a test, and ``configs/`` holds what users run.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from time import perf_counter

import overlays
import references

ROOT = Path(__file__).parent.parent
CONFIGS, GEARSTAB = ROOT / "configs", ROOT / "gearstab"

POINT_A = ("--mark", "A=4.2,0.3")
CAMPBELL = ("--kind", "campbell", "--size", "double")
ROOT_STRESS = ("--kind", "teeth", "--variable", "root_stress")
PICTURES: dict[str, dict[str, Sequence[str]]] = {
    "campbell/planetary": {
        "": ("--kind", "campbell", "--x", "supports.planet", "--select", "mesh_frequency=3 kHz", "--size", "double"),
    },
    "campbell/reducer": {
        "": ("--kind", "campbell", "--select", "damping_ratio=0", "--size", "double"),
        "_damping": ("--kind", "campbell"),
    },
    **{
        f"drivetrains/{name}": {
            "": (),
            "_campbell": (*CAMPBELL, "--select", select, "--title", f"{title}, modes and mesh orders"),
        }
        for name, select, title in (
            ("ev_reducer", "gears.helix_angle=4 deg", "Helical reducer of an electric car"),
            ("grc_750kw", "damping_factor=0.1", "GRC 750 kW gearbox"),
            ("helicopter", "damping_ratio=0.01", "Planetary stage of a helicopter"),
            ("nrel_5mw", "damping_factor=1", "NREL 5 MW gearbox"),
        )
    },
    "spinning/planetary": {"": (), "_campbell": CAMPBELL},
    "spinning/rotor": {"": (), "_campbell": CAMPBELL},
    "lin_parker_2002/fig8a": {"": POINT_A},
    "lin_parker_2002/fig8b": {"": POINT_A},
    "response/two_stage_speeds": {
        "": ("--title", "Stability of a two-stage train under load"),
        "_force": ("--kind", "speeds", "--select", "epsilon=0.3", "--title", "Load factors of a two-stage train"),
    },
    "response/run_up": {"": (), "_orders": ("--kind", "orders")},
    "kuria_kihiu_2008/steady": {
        "": ("--kind", "teeth", "--title", "Loads of a tooth (Kuria & Kihiu 2008, Fig. 6)"),
        "_fig7": (*ROOT_STRESS, "--title", "Root stress of a tooth (Kuria & Kihiu 2008, Figs. 7 and 8)"),
    },
    **{
        f"kuria_kihiu_2008/designs/stage4_{name}": {"": ROOT_STRESS}
        for name in ("m30", "m25", "m20", "a25", "m25_long", "m20_long")
    },
    **{
        f"kuria_kihiu_2008/designs/stages12_{name}": {
            "": ("--kind", "spectrum", "--variable", "mesh_deflection_amplitude")
        }
        for name in ("m30", "m25", "m20", "a25")
    },
    **{
        f"kuria_kihiu_2008/{name}": {"": ("--kind", "response", "--variable", "mesh_deflection")}
        for name in ("friction", "friction_none")
    },
    "parker_2009/table1": {"": ("--kind", "modes")},
    "lin_parker_1999/modes": {"": ("--kind", "modes")},
    "cooley_parker_2012/at_rest": {"": ("--kind", "modes")},
    "kuria_kihiu_2008/contact_ratio": {
        "": ("--kind", "curve", "--variable", "transmission_error_first_harmonic"),
    },
}
"""Options of ``gearstab plot`` where its choice is not the figure wanted: by configuration and ending of the name."""


@dataclass(frozen=True)
class Figure:
    """A configuration, its result and its pictures; ``folder`` is where results go, ``format`` png, pdf or svg."""

    name: str
    folder: Path
    format: str = "png"

    @property
    def config(self) -> Path:
        """The configuration."""
        return CONFIGS / f"{self.name}.yaml"

    @property
    def result(self) -> Path:
        """The result file."""
        return self.folder / f"{self.name}.h5"

    @property
    def pictures(self) -> dict[Path, Sequence[str]]:
        """Paths of the pictures and the options that draw each."""
        chosen = PICTURES.get(self.name, {"": ()})
        stem = self.folder / "figures" / self.name
        return {stem.with_name(f"{stem.name}{ending}.{self.format}"): words for ending, words in chosen.items()}

    @property
    def overlays(self) -> dict[Path, overlays.Overlay]:
        """Pictures that show it together with other figures."""
        folder = self.folder / "figures"
        return {folder / f"{name}.{self.format}": overlay for name, overlay in overlays.of_figure(self.name).items()}

    @property
    def every_picture(self) -> list[Path]:
        """The paths of all pictures."""
        return [*self.pictures, *self.overlays]

    @property
    def compared(self) -> bool:
        """Whether it has a reference: not where an optimiser chose the numbers, whose way differs between processors.

        The tests of designs compare those with scans.
        """
        return not self.has("design")

    def has(self, section: str) -> bool:
        """Whether the configuration has a section."""
        return bool(re.search(rf"^{section}:", self.config.read_text(), re.M))

    @property
    def command(self) -> list[str]:
        """The ``gearstab`` command that makes the result."""
        if self.has("respond"):
            return ["respond", str(self.config), "-o", str(self.result)]
        if self.has("design"):
            return ["design", str(self.config), "-o", str(self.result), "-q"]
        return ["sweep", str(self.config), "-o", str(self.result), "--overwrite", "-q"]


def run(words: Iterable[str]) -> float:
    """Run a ``gearstab`` command; returns the seconds of processor time it took, or (Windows) of real time."""
    start = clock()
    done = subprocess.run([sys.executable, "-m", "gearstab", *words], capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(f"gearstab {' '.join(words)} failed:\n{done.stderr}")
    return clock() - start


def clock() -> float:
    """Processor time of finished commands, which other work on the machine does not change; else real time."""
    times = os.times()
    return perf_counter() if os.name == "nt" else times.children_user + times.children_system


def newest(files: Iterable[Path]) -> float:
    """When the last of some files was changed."""
    return max(file.stat().st_mtime for file in files)


def numerics() -> list[Path]:
    """The sources that results depend on: all but those of plots, texts and the command line."""
    files = [*GEARSTAB.rglob("*.py"), *GEARSTAB.rglob("*.[ch]")]
    return [file for file in files if file.relative_to(GEARSTAB).parts[0] not in ("plots", "cli", "info")]


@cache
def make(figure: Figure) -> tuple[float, float]:
    """Bring the result and the pictures of a figure up to date; returns the seconds for the one and the others.

    Once a run: an overlay may have asked for it before its turn comes.
    """
    computed = drawn = 0.0
    data = (path for path in figure.config.parent.glob("*") if path.suffix in (".csv", ".npz"))
    if not figure.result.exists() or figure.result.stat().st_mtime < newest([figure.config, *data, *numerics()]):
        figure.result.parent.mkdir(parents=True, exist_ok=True)
        computed = run(figure.command)
    sources = [figure.result, Path(__file__), Path(overlays.__file__), *(GEARSTAB / "plots").rglob("*.py")]
    for picture, options in figure.pictures.items():
        if not picture.exists() or picture.stat().st_mtime < newest(sources):
            picture.parent.mkdir(parents=True, exist_ok=True)
            drawn += run(["plot", str(figure.result), "-o", str(picture), *options])
    for picture, overlay in figure.overlays.items():
        others = [replace(figure, name=name) for name in overlay.results]
        for other in others[1:]:
            make(other)
        if not picture.exists() or picture.stat().st_mtime < newest([*sources, *(other.result for other in others)]):
            overlays.draw(overlay, {other.name: other.result for other in others}, picture)
    return computed, drawn


def every(folder: Path, format: str = "png") -> list[Figure]:
    """All figures, in the order of their names."""
    paths = [path for path in sorted(CONFIGS.rglob("*.yaml")) if path.parent.name != "benchmarks"]
    return [Figure(path.relative_to(CONFIGS).with_suffix("").as_posix(), folder, format) for path in paths]


def chosen(names: Sequence[str], folder: Path, format: str = "png") -> list[Figure]:
    """The figures with these names or in these folders; all without names."""
    figures = every(folder, format)
    wanted = [name.removeprefix("configs/").removesuffix(".yaml").rstrip("/") for name in names]
    for name in wanted:
        if not any(f"{figure.name}/".startswith(f"{name}/") for figure in figures):
            sys.exit(f"no figure {name!r}; the figures: {', '.join(figure.name for figure in figures)}")
    return [f for f in figures if not wanted or any(f"{f.name}/".startswith(f"{name}/") for name in wanted)]


def quickest(figures: Sequence[Figure], seconds: float) -> list[Figure]:
    """As many figures as are made within a time, the quickest first, in their order."""
    kept, left = set(), seconds
    for figure in sorted(figures, key=lambda figure: references.seconds(figure.name)):
        left -= references.seconds(figure.name)
        if left >= 0:
            kept.add(figure.name)
    return [figure for figure in figures if figure.name in kept]


def main(arguments: Sequence[str]) -> int:
    """Make, and check or update; returns the exit code."""
    parser = argparse.ArgumentParser(description="Make the figures of configs/ and compare them with the references.")
    parser.add_argument("names", nargs="*", metavar="NAME", help="a configuration or a folder of them [default: all]")
    parser.add_argument("--folder", type=Path, default=ROOT / "results", help="where results go [default: results/]")
    parser.add_argument("--within", type=float, metavar="SECONDS", help="only the quickest, by their stored times")
    parser.add_argument("--format", choices=["png", "pdf", "svg"], default="png", help="of the pictures [default: png]")
    action = parser.add_mutually_exclusive_group()
    action.add_argument("--check", action="store_true", help="compare with the references")
    action.add_argument("--update", action="store_true", help="write the references anew")
    given = parser.parse_args(arguments)
    if given.format != "png" and (given.check or given.update):
        parser.error("--check and --update compare PNG files: leave --format out")
    figures = chosen(given.names, given.folder, given.format)
    start = perf_counter()
    if given.within is not None:
        figures = quickest(figures, given.within)
    total, failed = 0.0, 0
    for figure in figures:
        times = make(figure)
        total += sum(times)
        print(f"{figure.name:42} computed in {times[0]:6.1f} s, drawn in {times[1]:5.1f} s", flush=True)
        if given.update and figure.compared:
            references.write(figure.name, figure.result, figure.every_picture, times)
        if not (given.check and figure.compared):
            continue
        if wrong := references.differences(figure.name, figure.result, figure.every_picture):
            failed += 1
            print("".join(f"    differs: {line}\n" for line in wrong), end="", flush=True)
    passed = perf_counter() - start
    print(f"{len(figures)} figures in {passed:.0f} s, {total:.0f} s of processor time on {os.cpu_count()} processors")
    if given.check:
        print(f"{failed} differ from tests/data/figures/" if failed else "all agree with tests/data/figures/")
        if reason := references.pictures_left_out():
            print(reason)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
