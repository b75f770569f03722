"""`python -m terratool`."""

from terratool.cli.main import main

main()
