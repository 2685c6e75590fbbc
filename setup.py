"""Build of the optional C kernel; everything else stands in pyproject.toml.

Without a working compiler the package installs all the same and its NumPy kernel serves.
"""

from __future__ import annotations

import logging
from glob import glob

from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext
from setuptools.errors import BaseError, CCompilerError

SOURCES = sorted(glob("gearstab/floquet/_kernel*.c"))
HEADERS = sorted(glob("gearstab/floquet/_kernel*.h"))


class BuildKernel(build_ext):
    """Build the kernel where that works; elsewhere say once that the NumPy kernel serves."""

    def build_extension(self, ext: Extension) -> None:
        """Build one extension, or say why not."""
        try:
            super().build_extension(ext)
        except (CCompilerError, BaseError, OSError) as error:
            logging.warning(
                "gearstab: the compiled kernel was not built (%s); the NumPy kernel serves, with the same results. "
                "Install a C compiler and the Python headers and install again for the faster one.",
                str(error).splitlines()[0] if str(error) else type(error).__name__,
            )


setup(
    ext_modules=[Extension("gearstab.floquet._kernel", SOURCES, depends=HEADERS, optional=True)] if SOURCES else [],
    cmdclass={"build_ext": BuildKernel},
)
