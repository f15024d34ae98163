"""What several rooms' tests share: the independent referee, and random problems of every option."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
