"""One policy on many bodies: maps of modes and cost, and the transition's frequency against each parameter."""
