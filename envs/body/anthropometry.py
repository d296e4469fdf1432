"""A person's body from mass, stature and sex, by the table of de Leva (1996) in envs/body/proportions.yaml.

The body stands upright with its arms at its sides. Rules beside the table:

- Head, trunk, thigh and shank keep the table's proportions to each other and, with the height of the ankle, add up to the
  stature: the table's lengths, measured along the segments, times 0.98 for men and 1.00 for women. Arms and feet have the
  table's share of the stature.
- Masses keep the table's proportions and add up to the body's (the table's are 99.99 % for women).
- Joints and centres of mass lie above the ankle joint, but for the foot's, which is halfway between sole and ankle joint.

Axes and signs are those of envs/body/model.py; the origin is on the ground, below the ankle joints, in the midplane.
"""

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from envs.config import Person

Array = NDArray[np.float64]

MIDLINE = ("head", "trunk")
UPRIGHT = (*MIDLINE, "thigh", "shank")
"""Segments whose lengths add up to the stature above the ankle."""


@dataclass(frozen=True, eq=False)
class Segment:
    """mass [kg]; length [m]; com: centre of mass from the upper end, of the foot from the heel [m]; gyration: radii about
    its sagittal, transverse and longitudinal axis through the centre of mass [m], (3,)."""

    mass: float
    length: float
    com: float
    gyration: Array


@dataclass(frozen=True, eq=False)
class Rigid:
    """A rigid body: mass [kg], centre of mass [m] (3,), inertia about it [kg m2] (3, 3)."""

    mass: float
    com: Array
    inertia: Array


@dataclass(frozen=True, eq=False)
class Anatomy:
    """The upright body. Heights above the ground [m]: ankle, knee, hip, shoulder, elbow, wrist and stature. Along x from the
    ankle [m]: heel and toe, the ends of the foot, and sole, those of its contact line. Distances from the midplane [m]:
    hip_width, ankle_width. head, hand: heights of their centres of mass [m]. hat: head, arms and trunk. leg: left thigh and
    shank. foot: the left one.
    """

    ankle: float
    knee: float
    hip: float
    shoulder: float
    elbow: float
    wrist: float
    stature: float
    heel: float
    toe: float
    sole: tuple[float, float]
    hip_width: float
    ankle_width: float
    head: float
    hand: float
    hat: Rigid
    leg: Rigid
    foot: Rigid


def anatomy(person: Person) -> Anatomy:
    """The body of `person`."""
    numbers, segment = _proportions(), segments_of(person)
    length = {name: one.length for name, one in segment.items()}
    ankle = numbers["ankle_height"] * person.height
    knee = ankle + length["shank"]
    hip = knee + length["thigh"]
    cervicale = hip + length["trunk"]
    table = numbers["de_leva"][person.sex]
    shoulder = hip + length["trunk"] * table["shoulders"] / table["trunk"][0]
    elbow = shoulder - length["upper_arm"]
    wrist = elbow - length["forearm"]
    width = {name: share * person.height for name, share in numbers["from_midplane"].items()}
    heel = -numbers["ankle_from_heel"] * length["foot"]

    def hanging(name: str, top: float, side: float) -> Rigid:
        """A segment that hangs down from the height `top`, at the distance `side` from the midplane."""
        one = segment[name]
        return Rigid(one.mass, np.array([0.0, side, top - one.com]), one.mass * np.diag(one.gyration**2))

    arms = [
        hanging(name, top, sign * width[name])
        for name, top in (("upper_arm", shoulder), ("forearm", elbow), ("hand", wrist))
        for sign in (1.0, -1.0)
    ]
    # The leg leads straight from hip joint to ankle joint.
    slope = (width["hip"] - width["ankle"]) / (hip - ankle)
    legs = [
        hanging(name, top, width["ankle"] + slope * (top - segment[name].com - ankle))
        for name, top in (("thigh", hip), ("shank", knee))
    ]
    # The foot's longitudinal axis points forward, its sagittal axis up.
    foot, up = segment["foot"], segment["foot"].gyration[::-1]
    place = np.array([heel + foot.com, width["ankle"], ankle / 2])
    head = hanging("head", person.height, 0.0)
    return Anatomy(
        ankle=ankle,
        knee=knee,
        hip=hip,
        shoulder=shoulder,
        elbow=elbow,
        wrist=wrist,
        stature=person.height,
        heel=heel,
        toe=heel + length["foot"],
        sole=(heel + numbers["sole"][0] * length["foot"], heel + numbers["sole"][1] * length["foot"]),
        hip_width=width["hip"],
        ankle_width=width["ankle"],
        head=float(head.com[2]),
        hand=float(arms[-1].com[2]),
        hat=joined(head, hanging("trunk", cervicale, 0.0), *arms),
        leg=joined(*legs),
        foot=Rigid(foot.mass, place, foot.mass * np.diag(up**2)),
    )


def segments_of(person: Person) -> dict[str, Segment]:
    """The segments of `person` by name, of limbs one of each pair."""
    numbers = _proportions()
    table = {name: row for name, row in numbers["de_leva"][person.sex].items() if isinstance(row, list)}
    stature = numbers["de_leva"][person.sex]["stature"]
    total = sum(row[1] * (1 if name in MIDLINE else 2) for name, row in table.items())
    upright = (1.0 - numbers["ankle_height"]) * stature / sum(table[name][0] for name in UPRIGHT)
    found = {}
    for name, (length, mass, com, *gyration) in table.items():
        metres = length / stature * person.height * (upright if name in UPRIGHT else 1.0)
        found[name] = Segment(mass / total * person.mass, metres, com / 100 * metres, np.array(gyration) / 100 * metres)
    return found


def joined(*parts: Rigid) -> Rigid:
    """The parts as one rigid body, by the parallel-axis theorem."""
    mass = sum(part.mass for part in parts)
    com = sum((part.mass * part.com for part in parts), np.zeros(3)) / mass
    inertia = np.zeros((3, 3))
    for part in parts:
        lever = part.com - com
        inertia += part.inertia + part.mass * (lever @ lever * np.eye(3) - np.outer(lever, lever))
    return Rigid(mass, com, inertia)


@cache
def _proportions() -> dict[str, Any]:
    found: dict[str, Any] = yaml.safe_load(Path(__file__).with_name("proportions.yaml").read_text(encoding="utf-8"))
    return found
