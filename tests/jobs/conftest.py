"""Work functions are found by name in the workers, which get this process's search path."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
