"""What is asked of people, asked of a policy: hysteresis, critical fluctuations, recovery from pushes."""
