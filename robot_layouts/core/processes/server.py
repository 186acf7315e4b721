"""What the standard library's fork server has loaded before it forks our workers.

Nothing else imports this module. The server ends with the process that started it, and its forks
end with the server.
"""

from __future__ import annotations

import gc
import os
import sys
from importlib import import_module

from robot_layouts.core.processes.start import PRELOAD, SERVER_OF, end_with_parent

if os.environ.get(SERVER_OF) == str(os.getppid()):
    end_with_parent()
    # Python before 3.11 knows no safe path, and looks for modules in the present folder first
    sys.path[:] = os.environ["PYTHONPATH"].split(os.pathsep)
    for module in os.environ[PRELOAD].split():
        import_module(module)
    gc.collect()
    gc.freeze()  # no worker's collector writes to memory that all of them share
