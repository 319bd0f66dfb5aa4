"""What does geometry say? Analytical and semi-empirical estimate."""
