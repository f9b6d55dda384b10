"""Who goes through the protocols: the trained policy, the untrained one below it, the clips above it."""

TRAINED, UNTRAINED, REPLAYED = "trained", "untrained", "replayed"
SOURCES = {TRAINED: "this run", UNTRAINED: "untrained", REPLAYED: "clips replayed"}
"""By name, as a column's title."""
