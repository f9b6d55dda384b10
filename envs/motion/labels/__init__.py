"""Where the skill labels of clips come from: their names, a file, their motion, other clips, or chance."""

from murmillo.envs.motion.labels.chance import at_random
from murmillo.envs.motion.labels.classifier import ClassifierConfig, HeldOut, classify
from murmillo.envs.motion.labels.clusters import cluster
from murmillo.envs.motion.labels.names import RULES, from_names
from murmillo.envs.motion.labels.table import from_file, read_labels

__all__ = [
    "RULES",
    "ClassifierConfig",
    "HeldOut",
    "at_random",
    "classify",
    "cluster",
    "from_file",
    "from_names",
    "read_labels",
]
