"""Readers of motion files, one file a format; nothing that a file contains is run."""
