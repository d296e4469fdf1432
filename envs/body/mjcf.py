"""The MJCF of the stander: humanoid.xml itself, the paper's body, or the same with the measures of a person.

A person's body has the names, joints and solids of humanoid.xml. Its masses, centres of mass and inertias are those of
envs/body/anthropometry.py and are written out. The solids only show it: their lengths follow the joints, and their radii are
such that their volume follows the mass. The HAT's frame is midway between the shoulder joints, the leg's is the hip joint.
"""

from functools import lru_cache
from pathlib import Path
from xml.etree import ElementTree

import mujoco
import numpy as np

from envs.body.anthropometry import Anatomy, Rigid, anatomy
from envs.config import Person

MJCF = Path(__file__).with_name("humanoid.xml")


@lru_cache(maxsize=16)
def mjcf(person: Person | None) -> str:
    """The text of the MJCF with the body of `person`; None: the paper's."""
    text = MJCF.read_text(encoding="utf-8")
    return text if person is None else _with_measures(text, anatomy(person), person.mass)


def _with_measures(text: str, body: Anatomy, mass: float) -> str:
    """The MJCF `text` with the measures of `body`, which weighs `mass` [kg]."""
    root = ElementTree.fromstring(text)
    paper = mujoco.MjModel.from_xml_string(text)
    named = {element.get("name"): element for element in root.iter() if element.get("name")}
    head, hat = named["head"], named["hat"]
    arm_of_paper, leg_of_paper, ankle_of_paper = _landmarks(named)
    # Ratios to the paper's body: of its widths, of the radii of its solids, and of the height of its feet.
    wide = body.stature / (_numbers(hat, "pos")[2] + _numbers(head, "pos")[2] + _numbers(head, "size")[0])
    thick = float(np.sqrt(mass / paper.body_mass.sum() / wide))
    high = body.ankle / ankle_of_paper

    def reshape(name: str, heights: tuple[tuple[float, ...], tuple[float, ...]]) -> None:
        """Move the ends of a solid to other heights, (before, after), and scale the rest."""
        geom = named[name]
        key = "pos" if geom.get("fromto") is None else "fromto"
        points = _numbers(geom, key).reshape(-1, 3) * [wide, wide, 1.0]
        points[:, 2] = np.interp(points[:, 2], *heights)
        _set(geom, key, points.ravel())
        _set(geom, "size", thick * _numbers(geom, "size"))

    _set(hat, "pos", np.array([0.0, 0.0, body.shoulder]))
    trunk = (_numbers(named["leg_left"], "pos")[2], 0.0), (body.hip - body.shoulder, 0.0)
    for name in ("torso", "upper_waist", "lower_waist", "pelvis"):
        reshape(name, trunk)
    # The head is a capsule about its centre of mass, whose top is that of the body.
    radius, at = wide * _numbers(head, "size")[0], body.head - body.shoulder
    half = body.stature - body.head - radius
    head.set("type", "capsule")
    _set(head, "fromto", np.array([0.0, 0.0, at - half, 0.0, 0.0, at + half]))
    _set(head, "size", np.array([radius]))
    del head.attrib["pos"]
    arm = arm_of_paper, tuple(height - body.shoulder for height in (body.hand, body.wrist, body.elbow, body.shoulder))
    leg = leg_of_paper, (body.ankle - body.hip, body.knee - body.hip, 0.0)
    for side, sign in (("left", 1.0), ("right", -1.0)):
        for name in ("upper_arm", "lower_arm", "hand"):
            reshape(f"{name}_{side}", arm)
        for name in ("thigh", "shin"):
            reshape(f"{name}_{side}", leg)
        _set(named[f"leg_{side}"], "pos", np.array([0.0, sign * body.hip_width, body.hip - body.shoulder]))
        foot, joint = named[f"foot_{side}"], named[f"ankle_{side}"]
        above = high * _numbers(joint, "pos")[2]
        _set(foot, "pos", np.array([0.0, sign * (body.ankle_width - body.hip_width), body.ankle - body.hip - above]))
        _set(joint, "pos", np.array([0.0, 0.0, above]))
        for name in ("foot_inner", "foot_outer"):
            geom = named[f"{name}_{side}"]
            radius = high * _numbers(geom, "size")[0]
            points = _numbers(geom, "fromto").reshape(2, 3) * [1.0, wide, 1.0]
            points[:, 0] = body.heel + radius, body.toe - radius
            _set(geom, "fromto", points.ravel())
            _set(geom, "size", np.array([radius]))
        _add_inertial(named[f"leg_{side}"], body.leg, (0.0, body.hip_width, body.hip), sign)
        _add_inertial(foot, body.foot, (0.0, body.ankle_width, body.ankle - above), sign)
    _add_inertial(hat, body.hat, (0.0, 0.0, body.shoulder), 1.0)
    sole = next(element for element in root.iter("default") if element.get("class") == "sole").find("geom")
    compiler = root.find("compiler")
    assert sole is not None and compiler is not None
    line = high * _numbers(sole, "fromto")
    line[[0, 3]] = body.sole
    _set(sole, "fromto", line)
    _set(sole, "size", high * _numbers(sole, "size"))
    compiler.set("inertiafromgeom", "auto")
    return ElementTree.tostring(root, encoding="unicode")


def _landmarks(named: dict[str | None, ElementTree.Element]) -> tuple[tuple[float, ...], tuple[float, ...], float]:
    """Heights in humanoid.xml [m]: hand, wrist, elbow and shoulder in the HAT; ankle, knee and hip in the leg; the ankle
    above the ground."""

    def ends(name: str) -> tuple[float, float]:
        """Of a capsule, the upper and the lower one."""
        upper, lower = _numbers(named[name], "fromto")[[2, 5]]
        return float(upper), float(lower)

    def at(name: str) -> float:
        return float(_numbers(named[name], "pos")[2])

    (shoulder, above), (below, wrist) = ends("upper_arm_left"), ends("lower_arm_left")
    (_, over), (under, _) = ends("thigh_left"), ends("shin_left")
    ankle = at("foot_left") + at("ankle_left")
    arm = at("hand_left"), wrist, (above + below) / 2, shoulder
    return arm, (ankle, (over + under) / 2, 0.0), at("hat") + at("leg_left") + ankle


def _add_inertial(element: ElementTree.Element, rigid: Rigid, frame: tuple[float, float, float], side: float) -> None:
    """Give a body, whose `frame` is at this place of the upright body, the inertia of the left one, or its mirror image."""
    mirror = np.array([1.0, side, 1.0])
    inertia = rigid.inertia * np.outer(mirror, mirror)
    inertial = ElementTree.SubElement(element, "inertial")
    _set(inertial, "pos", mirror * (rigid.com - frame))
    _set(inertial, "mass", np.array([rigid.mass]))
    _set(inertial, "fullinertia", inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]])


def _numbers(element: ElementTree.Element, key: str) -> np.ndarray:
    return np.array(element.attrib[key].split(), dtype=np.float64)


def _set(element: ElementTree.Element, key: str, values: np.ndarray) -> None:
    element.set(key, " ".join(repr(float(value)) for value in values))
