"""The filters on the equations: compiled and filterpy."""
