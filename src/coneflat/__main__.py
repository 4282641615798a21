"""Entry point of `python -m coneflat`."""

from .apps.cli.main import main

if __name__ == "__main__":
    main()
