"""The benchmark is not installed: it is imported from the repository."""
from __future__ import annotations

from pathlib import Path
import sys

sys.path.insert(0, str(Path(__file__).parents[2]))
