"""python -m posture.play"""

from posture import cli
from posture.play import play
from posture.play.config import PlayConfig

if __name__ == "__main__":
    cli.run("play", PlayConfig, play)
