"""Machines on the command line: tasks that a trained agent of CALM does without further training."""
