"""A person's body against the table's own cross-checks, hand arithmetic, and measurements by others."""

import numpy as np
import pytest

from envs.body.anthropometry import Rigid, anatomy, joined, segments_of
from envs.config import Person

MEAN = {"female": Person(mass=61.9, height=1.735, sex="female"), "male": Person(mass=73.0, height=1.741, sex="male")}
"""The mean subjects of de Leva's table."""

# Rows of the table that are not in proportions.yaml: the three parts of the trunk, from cervicale, xiphion and omphalion on,
# and other ends of hand and trunk. (length [mm], mass [%], centre of mass [%], transverse radius of gyration [%])
TRUNK_PARTS = {
    "female": [(228.0, 15.45, 50.50, 31.4), (205.3, 14.65, 45.12, 35.4), (181.5, 12.47, 49.20, 40.2)],
    "male": [(242.1, 15.96, 50.66, 32.0), (215.5, 16.33, 45.02, 38.3), (145.7, 11.17, 61.15, 55.1)],
}
HAND_TO_FINGERTIP = {"female": (170.1, 0.56, 34.27, 20.8), "male": (187.9, 0.61, 36.24, 23.5)}
FROM_SHOULDERS = {"female": (497.9, 42.57, 37.82, 36.1), "male": (515.5, 43.46, 43.10, 35.8)}


@pytest.mark.parametrize("sex", MEAN)
def test_masses_add_up_to_the_body(sex):
    """Also those of the table, which are 99.99 % for women, 100 % for men."""
    person = MEAN[sex]
    body, segment = anatomy(person), segments_of(person)
    assert body.hat.mass + 2 * (body.leg.mass + body.foot.mass) == pytest.approx(person.mass, rel=1e-12)
    thigh = {"female": 14.78 / 99.99, "male": 14.16 / 100.0}
    assert segment["thigh"].mass == pytest.approx(thigh[sex] * person.mass, rel=1e-9)


@pytest.mark.parametrize("sex", MEAN)
def test_trunk_of_its_three_parts(sex):
    """The trunk's row is that of its parts put together, by the parallel-axis theorem: the centre of mass within 0.2 mm for
    women and 3 mm for men, the radius of gyration within 0.1 %."""
    parts, top, person = [], 0.0, MEAN[sex]
    for length, mass, com, gyration in TRUNK_PARTS[sex]:
        inertia = mass * np.diag([0.0, (gyration / 100 * length) ** 2, 0.0])
        parts.append(Rigid(mass, np.array([0.0, 0.0, -(top + com / 100 * length)]), inertia))
        top += length
    whole, trunk = joined(*parts), segments_of(person)["trunk"]
    assert whole.mass == pytest.approx(trunk.mass / person.mass * {"female": 99.99, "male": 100.0}[sex])
    assert -whole.com[2] / top == pytest.approx(trunk.com / trunk.length, abs={"female": 3e-4, "male": 5e-3}[sex])
    assert np.sqrt(whole.inertia[1, 1] / whole.mass) / top == pytest.approx(trunk.gyration[1] / trunk.length, rel=2e-3)


@pytest.mark.parametrize("sex", MEAN)
def test_rows_with_other_ends_give_the_same_places(sex):
    """Of the hand's centre of mass from the wrist, of the trunk's from the hip joints, and of their radii of gyration."""
    segment = segments_of(MEAN[sex])
    length, _, com, gyration = HAND_TO_FINGERTIP[sex]
    hand = segment["hand"]
    assert (hand.com, hand.gyration[1]) == pytest.approx((com * length * 1e-5, gyration * length * 1e-5), abs=1e-4)
    length, _, com, gyration = FROM_SHOULDERS[sex]
    trunk = segment["trunk"]
    # The trunk is 0.98 or 1.00 times as long as in the table, its parts as well.
    scale = trunk.length / {"female": 0.6148, "male": 0.6033}[sex]
    above_hip = trunk.length - trunk.com
    assert above_hip == pytest.approx(scale * (100 - com) * length * 1e-5, abs=2e-4)
    assert trunk.gyration[1] == pytest.approx(scale * gyration * length * 1e-5, abs=5e-4)
    body = anatomy(MEAN[sex])
    assert body.shoulder - body.hip == pytest.approx(scale * length * 1e-3, abs=1e-9)


def test_leg_by_hand():
    """A man of 80 kg and 1.80 m. The ankle is at 0.039 x 1.80 = 0.0702 m. Head, trunk, thigh and shank, 1708.7 mm in the
    table, share the other 1.7298 m: thigh 1.7298 x 422.2 / 1708.7 = 0.42742 m, shank 0.44574 m."""
    body = anatomy(Person(mass=80, height=1.80, sex="male"))
    assert (body.ankle, body.knee, body.hip) == pytest.approx((0.0702, 0.51594, 0.94336), abs=1e-5)
    # Thigh 11.328 kg, 0.17503 m (40.95 %) below the hip; shank 3.464 kg, 0.19590 m (43.95 %) below the knee.
    thigh, shank = 0.94336 - 0.17503, 0.51594 - 0.19590
    com = (11.328 * thigh + 3.464 * shank) / 14.792
    assert body.leg.mass == pytest.approx(14.792) and body.leg.com[2] == pytest.approx(com, abs=1e-5)
    # Radii of gyration 32.9 % and 24.6 %.
    own = 11.328 * (0.329 * 0.42742) ** 2 + 3.464 * (0.246 * 0.44574) ** 2
    apart = 11.328 * (thigh - com) ** 2 + 3.464 * (shank - com) ** 2
    # About y through the leg's centre of mass, and 0.1 mm of slant.
    assert body.leg.inertia[1, 1] == pytest.approx(own + apart, rel=1e-4)


def test_foot_by_hand():
    """A woman of 60 kg and 1.60 m: foot 228.3 / 1735 x 1.60 = 0.21054 m, 1.29 / 99.99 x 60 = 0.77408 kg."""
    body = anatomy(Person(mass=60, height=1.60, sex="female"))
    assert (body.heel, body.toe) == pytest.approx((-0.19 * 0.21054, 0.81 * 0.21054), abs=1e-5)
    assert body.sole == pytest.approx(((0.14 - 0.19) * 0.21054, (0.86 - 0.19) * 0.21054), abs=1e-5)
    assert body.foot.com[[0, 2]] == pytest.approx([(0.4014 - 0.19) * 0.21054, 0.039 * 1.60 / 2], abs=1e-5)
    radii = np.array([0.139, 0.279, 0.299]) * 0.21054  # about the long axis, from side to side, and the vertical
    assert np.diag(body.foot.inertia) == pytest.approx(0.77408 * radii**2, rel=1e-4)


def test_the_stature_is_that_of_the_person():
    for sex in MEAN:
        body, segment = anatomy(Person(mass=70, height=1.7, sex=sex)), segments_of(Person(mass=70, height=1.7, sex=sex))
        assert body.hip + segment["trunk"].length + segment["head"].length == pytest.approx(1.7, abs=1e-12)


def test_heights_of_a_mans_joints_are_those_of_drillis_and_contini():
    """In Winter (2009), Fig. 4.1, from other subjects: knee 0.285, hip 0.530 and shoulder 0.818 of the stature; wrist, by
    upper arm 0.186 and forearm 0.146, 0.486. Within 1.2 % of the stature, which the wrist needs."""
    body = anatomy(MEAN["male"])
    shares = np.array([body.knee, body.hip, body.shoulder, body.wrist]) / body.stature
    assert shares == pytest.approx([0.285, 0.530, 0.818, 0.486], abs=0.012)


INCH, POUND, INCH_POUND_S2 = 0.0254, 0.45359, 0.112985


@pytest.mark.parametrize(
    ("height", "weight", "from_top", "inertia"),
    [(72.2, 173.5, 32.2, 119.0), (67.4, 147.3, 29.8, 81.9), (73.3, 203.0, 31.8, 129.0)],
)
def test_whole_body_of_three_men_who_were_weighed_and_swung(height, weight, from_top, inertia):
    """Santschi, DuBois and Omoto (1963), in Toezeren, Human Body Dynamics (2000), Table A.2.1: men standing with their arms
    at their sides, on a compound pendulum. Stature [in], weight [lb], centre of mass from the top of the head [in], moment
    of inertia about the transverse axis through it [lb in s2].

    Here the centre of mass is 1.1 % of the stature higher to 0.2 % lower than measured, and the moment of inertia 1 to 12 %
    larger.
    """
    body = anatomy(Person(mass=weight * POUND, height=height * INCH, sex="male"))
    whole = joined(body.hat, *2 * [body.leg], *2 * [body.foot])
    assert whole.com[2] / body.stature == pytest.approx(1.0 - from_top / height, abs=0.012)
    assert 1.0 < whole.inertia[1, 1] / (inertia * INCH_POUND_S2) < 1.13


def test_bodies_of_one_sex_differ_in_scale_alone():
    """Twice the mass and 1.2 times the stature: lengths, masses and moments of inertia by 1.2, 2 and 2 x 1.44."""
    small, large = (anatomy(Person(mass=m, height=h, sex="female")) for m, h in ((50, 1.5), (100, 1.8)))
    for name in ("hat", "leg", "foot"):
        one, other = getattr(small, name), getattr(large, name)
        assert other.mass == pytest.approx(2 * one.mass) and other.com == pytest.approx(1.2 * one.com)
        assert other.inertia == pytest.approx(2 * 1.44 * one.inertia)
    assert (large.shoulder, large.toe) == pytest.approx((1.2 * small.shoulder, 1.2 * small.toe))
