"""From which error on a prediction of a channel is worth bettering."""

# Share of the standard deviation of a velocity. The hull of seed 818 lacks nothing; its sway is off
# by 3.1 times the noise of a good DVL, 2 % of what it varies, and its held-out maneuvers are
# predicted to 4 %.
VELOCITY_NRMSE = 0.05
# ... and of a rate. Turbulence stirs pitch as it does yaw, but a dive pitches at a third of the
# rate that a turn has: six dives with nothing missing, or with all of it found, left 0.04 to 0.08.
RATE_NRMSE = {"r": 0.06, "q": 0.12}


def share_that_matters(channel: str) -> float:
    """Share of the standard deviation of a channel, velocity or rate, below which none matters."""
    return RATE_NRMSE.get(channel, VELOCITY_NRMSE)
