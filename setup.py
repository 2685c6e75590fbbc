"""Build of the C kernel; everything else stands in pyproject.toml.

Without a C compiler, and on Windows, that of the wheel `ziglang` is used, which scripts/compiler.py asks for. If it
does not work either, the build fails.
"""

from __future__ import annotations

import os
import runpy
import shlex
import sys
import sysconfig
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from glob import glob
from hashlib import sha256
from pathlib import Path
from typing import Any

from setuptools import Extension, setup
from setuptools._distutils.ccompiler import new_compiler
from setuptools.command.build_ext import build_ext
from setuptools.command.build_py import build_py
from setuptools.command.sdist import sdist
from setuptools.errors import BaseError, CCompilerError, CompileError

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "scripts"))
import compiler

SOURCES = sorted(glob("gearstab/ckernel/**/*.c", recursive=True))
HEADERS = sorted(glob("gearstab/ckernel/**/*.h", recursive=True))
FOLDERS = sorted({os.path.dirname(path) for path in (*SOURCES, *HEADERS)})

# One binary serves every Python from 3.11 on; a build without the global lock has no stable interface yet.
STABLE_INTERFACE = not sysconfig.get_config_var("Py_GIL_DISABLED")


class BuildKernel(build_ext):
    """Build the kernel, or fail in one line."""

    def run(self) -> None:
        """Build all; a kernel that an earlier build left in the tree must not outlive a failed one."""
        for ext in self.extensions if self.inplace else []:
            self.remove(ext)
        super().run()

    def remove(self, ext: Extension) -> None:
        """Remove what an earlier build left where the next one goes."""
        with suppress(OSError):
            os.remove(self.get_ext_fullpath(ext.name))

    def get_libraries(self, ext: Extension) -> list[str]:
        """Name the library of Python on Windows, where others than Microsoft's compiler must be told."""
        if os.name != "nt":
            return list(super().get_libraries(ext))
        return ["python3" if STABLE_INTERFACE else f"python{sys.version_info.major}{sys.version_info.minor}t"]

    def build_extension(self, ext: Extension) -> None:
        """Build one extension, or say why not."""
        self.compiler: Any = with_zig(vars(self)["compiler"])
        # Python's own flags ask for debug sections, three quarters of the library. Vectors are passed within a file
        # only, so that the convention for passing them does not matter. Of what -O3 adds, small loops without a test
        # for their end and vectors of whole loops make maps and exponents up to a fifth faster; the rest takes time to
        # build only. Clang does both at -O2, and says that it ignores the wish.
        ext.extra_compile_args = ["-O2", "-fpeel-loops", "-fvect-cost-model", "-Wno-ignored-optimization-argument"]
        ext.extra_compile_args += ["-g0", "-ffp-contract=fast", "-fno-math-errno", "-Wno-psabi"]
        # After those above, as CFLAGS would not be.
        ext.extra_compile_args += shlex.split(os.environ.get("GEARSTAB_CFLAGS", ""))
        self.compiler.compile = side_by_side(self.compiler.compile)
        try:
            super().build_extension(ext)
        except (CCompilerError, BaseError, OSError) as error:
            self.remove(ext)
            reason = str(error).splitlines()[0] if str(error) else type(error).__name__
            raise CompileError(
                f"gearstab: its kernel cannot be compiled ({reason}): "
                "it needs GCC, Clang or the package ziglang, and the headers of Python"
            ) from None


def with_zig(given: Any) -> Any:
    """Return zig's compiler where there is no other, and in place of Microsoft's; else the given one.

    Windows is untried: its Python must be told the size of a pointer by compilers that are not Microsoft's.
    """
    microsoft = given.compiler_type == "msvc"
    zig = compiler.zig_instead_of([] if microsoft else given.compiler_so)
    if not zig:
        return given
    chosen: Any = new_compiler(compiler="unix") if microsoft else given
    if microsoft:
        chosen.set_include_dirs(given.include_dirs)
        chosen.set_library_dirs(given.library_dirs)
    system = ["-DMS_WIN64"] if os.name == "nt" else ["-fPIC"]
    chosen.set_executables(
        compiler_so=[*zig, *system, "-fno-sanitize=undefined", "-DNDEBUG", "-fwrapv"],
        linker_so=[*zig, "-shared", "-s"],
    )
    return chosen


def side_by_side(compile_files: Callable[..., list[str]]) -> Callable[..., list[str]]:
    """Return a version of a compiler's ``compile`` that uses all processors, the longest files first."""

    def compiled(sources: list[str], **options: Any) -> list[str]:
        order = sorted(sources, key=lambda path: not os.path.basename(path).startswith("level_"))
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            return [path for paths in pool.map(lambda one: compile_files([one], **options), order) for path in paths]

    return compiled


def note_commit(folder: str) -> None:
    """Write the commit into a package that is being built, where it is known."""
    version = runpy.run_path(os.path.join(os.path.dirname(os.path.abspath(__file__)), "gearstab", "version.py"))
    if found := version["commit"]():
        Path(folder, "gearstab", version["BUILT"]).write_text(f"{found}\n", encoding="ascii")


class BuildPackage(build_py):
    """Build the Python files, with the commit that they are of."""

    def run(self) -> None:
        """An editable install has the repository itself."""
        super().run()
        if not self.editable_mode:
            note_commit(self.build_lib)


class SourceDistribution(sdist):
    """Besides the package, which setuptools finds: what the tests and the documentation need."""

    def make_distribution(self) -> None:
        """Add the folders of the repository to the files that are packed."""
        self.filelist.extend(["Makefile", "CITATION.cff"])
        for folder in ("configs", "docs", "scripts", "tests"):
            self.filelist.graft(folder)
        self.filelist.global_exclude("*.py[cod]")
        self.filelist.global_exclude("*.so")
        super().make_distribution()

    def make_release_tree(self, base_dir: str, files: list[str]) -> None:
        """Add the commit, which the archive cannot know by itself."""
        super().make_release_tree(base_dir, files)
        note_commit(base_dir)


def kernel() -> Extension:
    """The extension module."""
    # By this number gearstab.ckernel tells a kernel that an update has left behind.
    files = sorted(map(Path, (*SOURCES, *HEADERS)))
    sources = sha256(b"".join(path.read_bytes() for path in files)).hexdigest()[:15]
    macros: list[tuple[str, str | None]] = [("GEARSTAB_SOURCES", f"0x{sources}")]
    stable: dict[str, Any] = {"py_limited_api": True} if STABLE_INTERFACE else {}
    return Extension(
        "gearstab.ckernel._kernel",
        SOURCES,
        depends=HEADERS,
        include_dirs=FOLDERS,
        define_macros=macros + ([("Py_LIMITED_API", "0x030b0000")] if STABLE_INTERFACE else []),
        **stable,
    )


setup(
    ext_modules=[kernel()],
    cmdclass={"build_ext": BuildKernel, "build_py": BuildPackage, "sdist": SourceDistribution},
    options={"bdist_wheel": {"py_limited_api": "cp311"}} if STABLE_INTERFACE else {},
)
