"""Run the command line as ``python -m warpspace``."""

from warpspace.cli import main

main()
