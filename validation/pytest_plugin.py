"""Where installations from before version 0.2 look for the plugin."""

from cablefem.pytest_plugin import *  # noqa: F403
