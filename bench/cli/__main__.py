"""`python -m bench.cli`: the same as `hil`."""

from bench.cli import main

main()
