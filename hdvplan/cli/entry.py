"""Where the process begins: nothing is imported here, so that Ctrl-C is answered from the first moment."""

from __future__ import annotations

import signal
import sys


def main() -> None:
    """Run the command line of this process and exit with its code."""
    code = 130  # interrupted, as shells report it
    try:
        from hdvplan.cli.app import run_process

        code = run_process()
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # all is said and written
    except KeyboardInterrupt:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        sys.stderr.write("error: interrupted\n")
    sys.exit(code)
