"""`python -m posture`: the same as the program `posture`."""

from posture.cli.console import main

if __name__ == "__main__":
    main()
