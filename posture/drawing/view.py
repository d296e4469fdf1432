"""A stander from the side, with its target: one pose at a time, into matplotlib axes."""

from __future__ import annotations

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.patches import Circle

from envs.config import Person
from posture.drawing.silhouette import DOT_RADIUS, draw_body, draw_ground, draw_target, head_position, target_height
from posture.drawing.style import GREY

X_RANGE = (-0.33, 0.43)  # shown around the body [m]
MARGIN = 0.07  # shown below the ground and above the target [m]
HEAD_DOT = 1.2 * DOT_RADIUS  # [m]


class StanderView:
    """The stander from the side, with its target and a dot at the centre of its head. `moving`: what `show` moves."""

    def __init__(self, ax: Axes, reach: float, person: Person | None = None) -> None:
        """The target moves between 0 and `reach` [m]. `person`: whose body it is; None: the paper's."""
        self.person, self.target_height = person, target_height(person)
        ax.set(xlim=X_RANGE, ylim=(-MARGIN, self.target_height + MARGIN))
        ax.set_axis_off()
        draw_ground(ax, *X_RANGE)
        ax.plot([0, reach], 2 * [self.target_height], color=GREY, lw=1.5, alpha=0.6, zorder=1)
        self.body = draw_body(ax, 0.0, 0.0, person=person)
        self.line, self.ball = draw_target(ax, 0.0, self.target_height)
        self.head = ax.add_patch(Circle((0.0, 0.0), HEAD_DOT, fc="black", ec="white", lw=0.7, zorder=3))
        self.moving: list[Artist] = [*self.body.layers, *self.body.joints, self.line, self.ball, self.head]

    def show(self, hip: float, ankle: float, foot_x: float, head_x: float, target_x: float) -> None:
        """Move to the joint angles [rad], and to the places of foot, head and target along x [m]."""
        height = head_position(hip, ankle, foot_x, self.person)[1]
        self.body.move(hip, ankle, foot_x)
        self.head.center = head_x, height
        self.ball.center = target_x, self.target_height
        self.line.set_data([target_x, target_x], [height, self.target_height])
