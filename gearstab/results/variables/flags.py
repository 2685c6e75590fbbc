"""Flags of a variable: names of the bits that its integers are sums of, as in the CF conventions."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from gearstab.system import Array


class Flags(dict[str, int]):
    """Bits by name; empty for a variable without any."""

    @classmethod
    def of(cls, attributes: Mapping[Any, Any]) -> Flags:
        """Return the flags that the attributes of a variable name, in a table or in a result that somebody changed."""
        names = str(attributes.get("flag_meanings", "")).split()
        return cls(zip(names, np.ravel(attributes.get("flag_masks", ())).tolist(), strict=False))

    @property
    def attributes(self) -> dict[str, Any]:
        """Attributes of a variable that has these flags."""
        return {"flag_masks": list(self.values()), "flag_meanings": " ".join(self)}

    @property
    def every(self) -> int:
        """Sum of all bits."""
        return int(np.bitwise_or.reduce([*self.values()], dtype=np.int64))

    def counted(self, values: Array) -> dict[str, int]:
        """Return how many values carry each flag; nothing of flags that none carries.

        Most flags are set nowhere, or everywhere, and few values carry any.
        """
        values = np.ravel(values, order="K")
        anywhere = int(np.bitwise_or.reduce(values))
        everywhere = int(np.bitwise_and.reduce(values)) if anywhere else 0
        marked = values[values != 0] if anywhere else values
        return {
            name: len(values) if everywhere & bit else int(np.count_nonzero(marked & values.dtype.type(bit)))
            for name, bit in self.items()
            if anywhere & bit
        }
