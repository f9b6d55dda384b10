"""Tasks on the command line: a high-level policy over a trained agent, or one that acts itself ("Scratch")."""
