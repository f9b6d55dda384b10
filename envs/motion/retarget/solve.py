"""Whole-body inverse kinematics (mink): the wished poses made to keep the joints' bounds and the ground."""

import mink
import mujoco
import numpy as np
from scipy.ndimage import gaussian_filter1d, maximum_filter1d

from murmillo.envs.errors import MotionError
from murmillo.envs.motion.retarget.bases import Floats
from murmillo.envs.motion.retarget.feet import FootPath
from murmillo.envs.motion.retarget.figure import Figure
from murmillo.envs.motion.retarget.limits import Ground, JointBounds
from murmillo.envs.motion.retarget.pose import Wish
from murmillo.envs.motion.retarget.skeleton_map import SIDES

_SOLVER = "daqp"
_FIRST_STEPS, _STEPS = 12, 3  # Gauss-Newton steps of the first frame, and of each that starts from the one before
_MOST_STEPS = 15  # where a body is still below the ground by more than
_DEPTH = 0.001  # [m]
_STANDING, _SWINGING = 25.0, 5.0  # position cost of a foot
_DAMPING = 0.02


class Solver:
    """Solves the frames of a clip in turn; each starts from its wish, corrected as the frame before had to be."""

    def __init__(self, figure: Figure) -> None:
        self._figure = figure
        model = figure.character.model
        self._model = model
        self._configuration = mink.Configuration(model)
        self._ground = Ground(model)
        self._limits = [JointBounds(figure), self._ground]
        self._root = mink.FrameTask(figure.character.bodies[0], "body", position_cost=12.0, orientation_cost=5.0)
        self._feet = [
            mink.FrameTask(f"{side}_foot", "body", position_cost=_STANDING, orientation_cost=[3.0, 3.0, 1.5])
            for side in SIDES
        ]
        self._hands = [
            mink.FrameTask(f"{side}_hand", "body", position_cost=6.0, orientation_cost=0.0) for side in SIDES
        ]
        self._posture = mink.PostureTask(model, cost=_posture_costs(figure))
        self._tasks = [self._root, *self._feet, *self._hands, self._posture]

    def solve(self, wish: Wish, place: str) -> Floats:
        """Poses [F, nq] as near to the wished ones as limits and ground let them be; `place` names them in errors.

        Raises:
            MotionError: a frame for which the solver finds nothing.
        """
        start = self._figure.clamped(wish.qpos)
        feet = [wish.paths[side] for side in SIDES]
        targets = [np.concatenate([path.rotation.as_quat(scalar_first=True), path.ankle], axis=1) for path in feet]
        costs = [_firmness(path) for path in feet]
        solved = np.empty_like(start)
        correction = np.zeros(self._model.nv)
        for frame, pose in enumerate(start):
            self._root.set_target(_se3(pose[3:7], pose[:3]))
            for task, target, cost in zip(self._feet, targets, costs, strict=True):
                task.set_target(mink.SE3(target[frame]))
                task.set_position_cost(cost[frame])
            for task, point in zip(self._hands, wish.hands[frame], strict=True):
                task.set_target(mink.SE3.from_translation(point))
            self._posture.set_target(pose)
            guess = pose.copy()
            mujoco.mj_integratePos(self._model, guess, correction, 1.0)
            self._configuration.update(guess)
            try:
                self._descend(_STEPS if frame else _FIRST_STEPS)
            except mink.NoSolutionFound:
                raise MotionError(f"{place}: frame {frame}: no pose keeps limits and ground; cut it out") from None
            solved[frame] = self._configuration.q
            mujoco.mj_differentiatePos(self._model, correction, 1.0, pose, solved[frame])
        return self._figure.clamped(solved)

    def _descend(self, steps: int) -> None:
        """Take that many steps, and more while a body is in the ground: what turns into it meets it only by and by."""
        for done in range(_MOST_STEPS):
            if done >= steps and self._ground.depth(self._configuration) < _DEPTH:
                break
            velocity = mink.solve_ik(
                self._configuration, self._tasks, 1.0, _SOLVER, damping=_DAMPING, limits=self._limits
            )
            self._configuration.integrate_inplace(velocity, 1.0)


def _firmness(path: FootPath) -> Floats:
    """Position cost of a foot [F]: where it stands it stays, whatever else gives way; in the air it is but a wish."""
    standing = gaussian_filter1d(maximum_filter1d(path.standing.astype(float), 3), 1.0)
    return _SWINGING + (_STANDING - _SWINGING) * standing


def _posture_costs(figure: Figure) -> Floats:
    """Cost [nv] of leaving the wished joints: legs and arms give way to feet and hands, trunk and neck less."""
    costs = np.full(figure.character.model.nv, 0.6)
    for name in ("abdomen", "neck"):
        costs[figure.joints[name].dof] = 2.0
    return costs


def _se3(quat: Floats, position: Floats) -> mink.SE3:
    return mink.SE3(np.concatenate([quat, position]))
