"""AdaptNet on the command line: base policies that navigate in a style, and their adaptation to what is new."""
