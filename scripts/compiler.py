"""Build backend: setuptools, and the compiler of the wheel `ziglang` where the machine has no C compiler.

As a script it prints that requirement, if there is one, for `make install`, whose build is not isolated.
"""

from __future__ import annotations

import os
import shlex
import shutil
import sys
import sysconfig
from importlib.util import find_spec
from typing import Any

from setuptools import build_meta
from setuptools.build_meta import *  # noqa: F403 - the hooks that a backend has

ZIG = "ziglang>=0.15"
"""Version 0.17.1 was tried: the kernel with all vector extensions, Linux x86-64."""


def requirements() -> list[str]:
    """Return what a build needs beside setuptools: nothing where there is a C compiler."""
    # Windows: Microsoft's compiler lacks the vector extensions of GCC and Clang in which the kernel is written.
    if os.name == "nt":
        return [ZIG]
    words = shlex.split(os.environ.get("CC") or sysconfig.get_config_var("CC") or "")
    return [] if words and shutil.which(words[0]) else [ZIG]


def zig_instead_of(command: list[str]) -> list[str]:
    """Return the command of zig's C compiler if ``command`` is not on the path and zig is installed, else nothing."""
    usable = bool(command) and shutil.which(command[0]) is not None
    return [] if usable or find_spec("ziglang") is None else [sys.executable, "-m", "ziglang", "cc"]


def get_requires_for_build_wheel(config_settings: Any = None) -> list[str]:
    """Return the requirements of a wheel, see PEP 517."""
    return [*build_meta.get_requires_for_build_wheel(config_settings), *requirements()]


def get_requires_for_build_editable(config_settings: Any = None) -> list[str]:
    """Return the requirements of an editable installation, see PEP 660."""
    return [*build_meta.get_requires_for_build_editable(config_settings), *requirements()]


if __name__ == "__main__":
    print(*requirements())
