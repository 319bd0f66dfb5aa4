"""How does it move? Terms, propagation, actuators, maneuver figures."""
