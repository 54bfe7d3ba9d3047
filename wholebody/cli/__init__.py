"""The command `wholebody`: one file for each of its commands.

Linear algebra computes on one thread, unless the environment says otherwise: on matrices as small as ours threads wait
for each other, which takes twice as long, or seven times where other processes compute too.
"""

import os

from wholebody.base.runner import ONE_THREAD

for _name, _value in ONE_THREAD.items():
    os.environ.setdefault(_name, _value)

from wholebody.cli.main import main  # noqa: E402 (numpy reads the environment when it is loaded)

__all__ = ["main"]
