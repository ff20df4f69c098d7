"""The command `cablefem`; Ctrl-C while it is loaded ends it without a word."""

import signal
import sys


def main() -> int:
    """Load and run the command; return its exit code."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # `cli.main` takes it then
    from validation import cli

    return cli.main()


if __name__ == "__main__":
    sys.exit(main())
