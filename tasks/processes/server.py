"""What the standard library's fork server has loaded before it forks our workers.

Nothing else imports this module. The server ends with the process that started it, and its forks
end with the server.
"""

from __future__ import annotations

import gc
import os
from importlib import import_module

from tasks.processes.start import SERVER_OF, end_with_parent

LOADED = ("tasks.fronts.workers", "robot_layouts.simulation")

if os.environ.get(SERVER_OF) == str(os.getppid()):
    end_with_parent()
    for module in LOADED:
        import_module(module)
    gc.collect()
    gc.freeze()  # no worker's collector writes to memory that all of them share
