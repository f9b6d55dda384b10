"""What the papers measure, as pure functions of recorded arrays; each says its equation and its source."""
