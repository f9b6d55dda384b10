"""The generator of the built-in clips: key poses and steps, solved to whole-body motion (needs the motion extra)."""
