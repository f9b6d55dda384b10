"""How well a policy of AdaptNet does: one episode in each world, and how far its motion is from the clips."""

from collections.abc import Sequence
from pathlib import Path

import torch
from torch import Tensor

from murmillo.agents.adaptnet.agent import AdaptNet
from murmillo.agents.common.rollout import tensors
from murmillo.cli.adaptation.base import BaseRun
from murmillo.cli.adaptation.config import AdaptNetTrainConfig
from murmillo.cli.adaptation.world import load_blended, make_agent, make_env
from murmillo.cli.blending import NOTHING, Blend
from murmillo.cli.evaluation.figures import Value
from murmillo.cli.tasks.measuring import Figures, Recorder
from murmillo.cli.tasks.players import TRAINED, UNTRAINED
from murmillo.envs import HumanoidVectorEnv
from murmillo.envs.character import CONTROL_DT
from murmillo.envs.metrics.tasks import imitation_error
from murmillo.envs.rotations import heading_quat, quat_rotate_inverse

LONGEST_S = 10.0
"""[s] Longer clips are no single motion to be compared with; without others there is no imitation error."""
_LEAST_FRAMES = 15
"""Shorter pieces are left out: almost any pose is near to some frame of a clip."""
_COMPARED = 32
"""Worlds whose motion is compared; to warp time takes longer than to simulate it."""


@torch.no_grad()
def measure(
    config: AdaptNetTrainConfig, base: BaseRun | None, folder: Path, worlds: int, seed: int, blend: Blend = NOTHING
) -> dict[str, Figures]:
    """Figures of the policy before and after training: the same episodes as far as the seed decides, mean actions.

    After training its adapters act as was told.

    Raises:
        AgentError: the checkpoint in `folder` is missing or does not fit.
        CommandError, SuiteError: the base or the environment cannot be used.
    """
    env = make_env(config, worlds)
    try:
        references = _references(env)
        players = {UNTRAINED: make_agent(config, base, env)[0], TRAINED: load_blended(config, base, env, folder, blend)}
        return {name: _play(env, player, references, seed) for name, player in players.items()}
    finally:
        env.close()


def _play(env: HumanoidVectorEnv, agent: AdaptNet, references: Sequence[Tensor], seed: int) -> Figures:
    recorder = Recorder(env)
    compared = min(_COMPARED, env.num_envs)
    motions: list[list[Tensor]] = [[] for _ in range(compared)]
    goal: list[Tensor] = []
    obs, _ = env.reset(seed=seed)
    recorder.begin(obs)
    while recorder.going:
        lasting = recorder.lasting
        for world, links in enumerate(_links(env.state.body_pos_w[:compared], env.state.body_quat_w[:compared, 0])):
            if lasting[world]:
                motions[world].append(links)
        action = agent.act(tensors(obs), deterministic=True).action
        results = env.step(action.numpy())
        obs, reward = results[0], torch.as_tensor(results[1])
        recorder(action, results)
        goal.append(reward[lasting])
    reward = torch.cat(goal)
    error = _imitation([torch.stack(motion) for motion in motions], references)
    return {"goal_reward": Value(reward.mean().item(), len(reward)), **recorder.figures(), **error}


def _imitation(motions: Sequence[Tensor], references: Sequence[Tensor]) -> Figures:
    """Eq. 15 over all pieces of the motions [T, L, 3], each from the reference that is nearest to it."""
    if not references:
        return {}
    errors = torch.cat([piece_errors(motion, _nearest(motion, references)) for motion in motions])
    if not len(errors):
        return {}
    spread = errors.std().item() if len(errors) > 1 else None
    return {"imitation_error": Value(errors.mean().item(), len(errors), spread, "single pieces")}


def _nearest(motion: Tensor, references: Sequence[Tensor]) -> Tensor:
    """The reference that the poses of a motion are nearest to, one by one."""
    if len(references) == 1:
        return references[0]
    return min(references, key=lambda reference: _distances(motion, reference).amin(1).mean().item())


def piece_errors(motion: Tensor, reference: Tensor) -> Tensor:
    """Eq. 15 [n] of a motion [T, L, 3], piece by piece, from the reference [F, L, 3], which is taken for a cycle.

    A piece is as long as the cycle, the last one as there is left; it is compared with as much of the cycle, from that
    frame on which is nearest to its own first one.
    """
    errors = []
    for piece in motion.split(len(reference)):
        if len(piece) >= _LEAST_FRAMES:
            begin = int(_distances(piece[:1], reference).argmin())
            errors.append(imitation_error(piece, reference.roll(-begin, 0)[: len(piece)]).mean)
    return torch.tensor(errors)


def _distances(motion: Tensor, reference: Tensor) -> Tensor:
    """Mean distance [T, F] of the links in every frame of the one from those in every frame of the other."""
    return torch.cdist(motion.transpose(0, 1), reference.transpose(0, 1)).mean(0)


def _references(env: HumanoidVectorEnv) -> list[Tensor]:
    """The links [F, L, 3] of each clip that is a single motion, a frame a control step."""
    library, character = env.library, env.character.base
    found = []
    for clip, duration in enumerate(library.duration.tolist()):
        if duration <= LONGEST_S:
            time = torch.arange(0.0, duration + 1e-6, CONTROL_DT, dtype=torch.float64)
            qpos, _ = library.pose(torch.full((len(time),), clip), time)
            pos_w, quat_w = character.forward_kinematics(qpos)
            found.append(_links(pos_w, quat_w[:, 0]))
    return found


def _links(pos_w: Tensor, root_quat_w: Tensor) -> Tensor:
    """Positions [n, L, 3] of the links relative to the root's, in its heading [m]."""
    return quat_rotate_inverse(heading_quat(root_quat_w)[:, None], pos_w - pos_w[:, :1]).float()
