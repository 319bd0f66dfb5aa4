"""Synthetic AUV sea trials from a six-degree-of-freedom plant.

The plant shares no code and no model structure with the identification program; it exists so that
the program can be tried on logs whose truth is known and is not of the program's own form.

Conventions: SNAME body axes at the origin O of the vehicle file (x forward, y starboard, z down);
velocities ``u, v, w`` [m/s], rates ``p, q, r`` [rad/s], angles roll, pitch, heading [rad];
a positive rudder has its trailing edge to port (bow turns to port), a positive elevator its
trailing edge down (bow down). SI and radians everywhere inside; degrees only in the log files.
"""
