"""Numbers that several parts of the program take, each with its source or its reason.

Of nature, of the normal distribution, and of what counts as long, as independent or as better.
A number that one module alone takes stands there.
"""

from typing import Annotated

# A time that is long or short for a vehicle of some metres at 1.5 m/s. Its own time L/U is about
# 1 s, that of a ship 20 to 40 s: what is marked so is fixed, and ought to grow with the vehicle.
VehicleTime = Annotated[float, "scales with L/U"]

GRAVITY_MPS2 = 9.80665  # standard gravity: CGPM 1901, resolution 2
# Rounded, in the search for waves: with all digits the ratio of powers that it reports moves by
# 2e-6 of itself.
GRAVITY_OF_WAVES_MPS2 = 9.81
USUAL_SPEED_MPS = 1.5  # cruising speed of small survey AUVs (REMUS 100: 1.54 m/s)

MEDIAN_OF_ABS_TO_STD = 1.4826  # standard deviation over median absolute deviation, normal
# Standard deviations on each side of a 95 % interval. The bounds of
# `auvident.estimation.innovations` take the quantile with all its digits.
NORMAL_95 = 1.96
NORMAL_90 = 1.645  # the same of a 90 % interval: 19 of 20 lie above its lower end
# the likelihood ratio of a parameter of no effect stays below it in 19 of 20 cases (Wilks 1938)
BEYOND_CHANCE_NATS = 0.5 * NORMAL_95**2

# A DVL loses the bottom for a few seconds now and then; a maneuver is not lost with it, a longer
# gap may hide a swing or a turn. The rows between are interpolated, flagged and carry no weight
# in the filters; they only bridge the segmentation and the channels a decoupled system takes as
# inputs.
BRIDGED_S: VehicleTime = 5.0
ANSWER_S: VehicleTime = 5.0  # less is over before a vehicle has answered its fin
INDEPENDENT_S: VehicleTime = 20.0  # errors of a prediction further apart count as independent

# The state at the start of a maneuver comes from a line through the readings around it, and is
# known to so many standard deviations: in a filter of the sensor's (effective) noise; in a fit of
# the residual's, wide, because the start is estimated along and the line bends where the rudder
# is laid at once; in the many fits of a diagnosis again of the residual's.
FILTER_START_STD = 3.0
FITTED_START_STD = 30.0
DIAGNOSED_START_STD = 5.0

NOT_MOVED = 0.05  # data share below which a coefficient stayed where the prior put it
NOT_BETTER = 1.0  # ratio of squared errors below which the data did not help
BAND_SHARE = 0.95  # of the readings, that the band of a prediction is to hold
