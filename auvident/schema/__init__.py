"""What is it called? Channels, coefficients, vehicle, plan, artifacts."""
