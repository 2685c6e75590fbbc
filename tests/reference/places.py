"""Where things lie in the source tree."""

from __future__ import annotations

from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
CONFIGS, DOCS, DATA = ROOT / "configs", ROOT / "docs", ROOT / "tests" / "data"
