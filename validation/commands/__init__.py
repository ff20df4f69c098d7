"""One folder per command, named as the command; see README.md."""
