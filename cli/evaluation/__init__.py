"""What `murmillo evaluate` is made of: protocols, recordings in chunks, the table of metrics, the report."""
