"""What the process has loaded from which workers are forked; to import this module loads it.

It is named to multiprocessing's fork server, which can be given modules to import and nothing else.
"""

import gc
import signal

from app.allocation.preloading import load_what_is_kept
from app.memory import give_back

# Ctrl-C reaches the whole group; this process ends with the service.
signal.signal(signal.SIGINT, signal.SIG_IGN)
load_what_is_kept()
gc.collect()
# Objects that the collector does not look at stay on pages that workers share.
gc.freeze()
give_back()
