"""The wheel holds conf/ as posture/conf; everything else about the package is in pyproject.toml."""

from setuptools import find_packages, setup

setup(
    packages=[*find_packages(include=["envs*", "posture*"]), "posture.conf"],
    package_dir={"posture.conf": "conf"},
)
