"""The command `wholebody`: one file for each of its commands.

Linear algebra computes on one thread, unless the environment says otherwise: on matrices as small as ours threads wait
for each other, which takes twice as long, or seven times where other processes compute too.
"""

import os
import signal
import threading

_usual = signal.getsignal(signal.SIGINT) is signal.default_int_handler
_usual = _usual and threading.current_thread() is threading.main_thread()
if _usual:  # Ctrl-C ends the process at once: libraries that are half imported make other errors of it
    signal.signal(signal.SIGINT, signal.SIG_DFL)

from wholebody.base.runner import ONE_THREAD  # noqa: E402

for _name, _value in ONE_THREAD.items():
    os.environ.setdefault(_name, _value)

from wholebody.cli.main import main  # noqa: E402 (numpy reads the environment when it is loaded)

if _usual:
    signal.signal(signal.SIGINT, signal.default_int_handler)

__all__ = ["main"]
