"""`wayside demo`: station and train client as processes of their own, simulated receivers, a story of faults, expected against seen."""
