"""Two motions of different pace, laid beside each other."""

import torch
from torch import Tensor


def warping_path(cost: Tensor) -> tuple[Tensor, Tensor]:
    """Dynamic time warping (Sakoe and Chiba 1978): the pairs of frames of least total cost.

    The path goes from the first pair to the last, a frame forward in one motion or in both at a time.

    Args:
        cost: [T, F] of laying frame t of the one beside frame f of the other, not negative.

    Returns:
        Frames of the one and of the other [P] int64, with max(T, F) <= P < T + F.
    """
    rows, columns = cost.shape
    total = cost.new_full((rows + 1, columns + 1), float("inf"), dtype=torch.float64)
    total[0, 0] = 0.0
    for diagonal in range(2, rows + columns + 1):  # nothing on a diagonal depends on the rest of it
        i = torch.arange(max(1, diagonal - columns), min(rows, diagonal - 1) + 1)
        j = diagonal - i
        before = torch.stack((total[i - 1, j - 1], total[i - 1, j], total[i, j - 1]))
        total[i, j] = cost[i - 1, j - 1] + before.amin(0)
    return _trace_back(total)


def _trace_back(total: Tensor) -> tuple[Tensor, Tensor]:
    """The path through the least totals [T + 1, F + 1]; of equal steps the one forward in both."""
    least = total.tolist()
    i, j = len(least) - 1, len(least[0]) - 1
    path = [(i, j)]
    while (i, j) != (1, 1):
        i, j = min(((i - 1, j - 1), (i - 1, j), (i, j - 1)), key=lambda cell: least[cell[0]][cell[1]])
        path.append((i, j))
    row, column = torch.tensor(path[::-1]).unbind(1)
    return row - 1, column - 1
