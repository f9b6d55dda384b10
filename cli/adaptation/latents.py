"""The latents Z^0 that policies of AdaptNet walk through, in the plane (AdaptNet, Figure 17)."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from murmillo.agents.adaptnet.agent import AdaptNet
from murmillo.agents.common.interface import Obs
from murmillo.agents.common.rollout import tensors
from murmillo.cli.adaptation.base import BaseRun
from murmillo.cli.adaptation.config import AdaptNetTrainConfig
from murmillo.cli.adaptation.world import load_agent, make_env
from murmillo.cli.errors import CommandError
from murmillo.envs.metrics.maps import classical_mds

_WORLDS = 16
_COLOURS = ("#1f4e79", "#c8553d", "#4d8b31", "#8e5aa5", "#d69f25", "#3aa0a8", "#7f7f7f", "#a33f6a")


@torch.no_grad()
def walk(config: AdaptNetTrainConfig, base: BaseRun | None, folder: Path, points: int, seed: int) -> Tensor:
    """Z^0 `[points, Z]` of a run's policy at moments spread evenly over its own episodes, with mean actions.

    Raises:
        AgentError: the checkpoint does not fit.
        SuiteError: the environment cannot be made.
    """
    env = make_env(config, min(_WORLDS, points))
    try:
        agent = load_agent(config, base, env, folder)
        obs, _ = env.reset(seed=seed)
        found = []
        for _ in range(config.env.episode_steps):
            seen = tensors(obs)
            found.append(latent(agent, seen))
            obs, *_ = env.step(agent.act(seen, deterministic=True).action.numpy())
        latents = torch.cat(found)
        return latents[torch.linspace(0, len(latents) - 1, points).long()]
    finally:
        env.close()


def latent(agent: AdaptNet, obs: Obs) -> Tensor:
    """Z^0 `[N, Z]` of a policy, with what its adapter adds."""
    state = agent.model.state_normalizer(agent.observed.state(obs))
    policy: Any = agent.model.policy
    return policy.encode(state, agent.observed.beside(obs))


def check_one_base(folders: Sequence[Path], bases: Sequence[str]) -> None:
    """Refuse runs whose latents lie in different spaces, told by the digests of their bases.

    Raises:
        CommandError: naming the run whose base is another one than the first's.
    """
    for folder, base in zip(folders, bases, strict=True):
        if base != bases[0]:
            raise CommandError(
                f"{folder}: its base is not that of {folders[0]}; latents of one base alone lie in one space"
            )


def draw(latents: dict[str, Tensor], out: Path) -> None:
    """Write the map of the latents `[n, Z]` of each name: distances are kept as well as a plane can."""
    # the object interface: pyplot would open the user's screen back end
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    together = torch.cat(list(latents.values())).double()
    places = classical_mds(torch.cdist(together, together)).split([len(points) for points in latents.values()])
    figure = Figure(figsize=(6.4, 5.6), dpi=120, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    for number, (name, place) in enumerate(zip(latents, places, strict=True)):
        colour = _COLOURS[number % len(_COLOURS)]
        axes.scatter(*place.T.numpy(), s=6, color=colour, alpha=0.5, linewidths=0, label=name)
    axes.set(xlabel="first axis", ylabel="second axis", aspect="equal")
    axes.legend(frameon=False, markerscale=3)
    axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(out)
