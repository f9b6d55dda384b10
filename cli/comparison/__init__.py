"""What `murmillo compare` is made of: reading runs, grouping them, statistics over seeds, curves and the page."""
