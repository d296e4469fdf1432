"""python -m posture.play"""

from posture import signals


def main() -> None:
    """The command; after Ctrl-C it exits with 130, after SIGTERM with 143, at whatever moment."""
    with signals.handled():
        # Only now, since these take seconds, in which one may think better of it.
        from posture import cli
        from posture.play import play
        from posture.play.config import PlayConfig

        cli.run("play", PlayConfig, play)


if __name__ == "__main__":
    main()
