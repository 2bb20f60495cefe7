"""Run the command line as ``python -m hdvplan``."""

from hdvplan.cli.entry import main

if __name__ == "__main__":
    main()
