"""Published hydrodynamic derivatives, with their sources.

SUBOFF: R. F. Roddy, Investigation of the stability and control characteristics of several
configurations of the DARPA SUBOFF model, DTRC/SHD-1298-08, 1990, table 4, on L_pp = 4.26086 m
about 2.013 m from the nose. Uncertainty: 4 to 5 % static, about 10 % rotary, 6 to 10 % of the
control, about 7 % of the added masses. The transcription at hand says that the fully appended
configurations (1 vertical, 2 horizontal) had ring wing 1 on; many papers take them as without.

REMUS: T. Prestero, MIT/WHOI 2001, tables B (combined coefficients); calculated, not measured.
His fin terms (Y_uv -9.64, Y_ur 6.15, N_uv 6.15, N_ur -3.93, Y_uud 9.64) are those of one fin of a
pair, and Y_uv of the tables leaves them out: here both fins count everywhere. Y_vv and N_rr of
the tables hold factors fitted to a trial (10 and 20): here without, tables 4.2 and 4.3. M_uw is
Munk's moment from the added mass of hull and fins, not cut at the tail.
"""

LENGTH_PP = 4.26086  # m

BARE = {"Y_uv": -0.005948, "N_uv": -0.012795, "Y_ur": 0.001811, "N_ur": -0.001597}
WITH_SAIL = {"Y_uv": -0.023008, "N_uv": -0.015534}
WITH_PLANES = {"Y_uv": -0.010494, "N_uv": -0.011254, "Y_ur": 0.006324, "N_ur": -0.003064}
APPENDED = {"Y_uv": -0.027834, "N_uv": -0.013648, "Y_ur": 0.005251, "N_ur": -0.004444}
VERTICAL = {
    "Z_uw": -0.013910,
    "M_uw": 0.010324,
    "Z_uq": -0.007545,
    "M_uq": -0.003702,
    "Z_wdot": -0.014529,
    "M_wdot": -0.000561,
    "Z_qdot": -0.000633,
    "M_qdot": -0.000860,
    "Z_uud": -0.005603,
    "M_uud": -0.002409,
}
TURNED = {"Y_uv": ("Z_uw", 1), "N_uv": ("M_uw", -1), "Y_ur": ("Z_uq", -1), "N_ur": ("M_uq", 1)}
"""What a body of revolution with equal planes has in the vertical plane, with the sign there."""


def turned(measured: dict[str, float]) -> dict[str, float]:
    """Measured in the horizontal plane without a sail, as it is in the vertical one."""
    return {TURNED[s][0]: TURNED[s][1] * value for s, value in measured.items()}


SUBOFF_KINDS = ("sail", "rudder", "elevator")
SUBOFF = (
    # configuration of the report, kinds of fins, prime values
    ("bare hull (3), turned", (), turned(BARE)),
    ("hull and planes (5), turned", ("rudder", "elevator"), turned(WITH_PLANES)),
    ("fully appended (1)", SUBOFF_KINDS, VERTICAL),
)

REMUS = {
    "X_uu": -1.62,
    "X_udot": -0.93,
    "Z_wdot": -35.5,
    "Z_qdot": -1.93,
    "M_qdot": -4.88,
    "X_wq": -35.5,
    "X_qq": -1.93,
    "Z_uw": -28.6 - 2.0 * 9.64,
    "Z_uq": 0.93 - 2.0 * 6.15,
    "Z_w|w|": -131.0,
    "Z_q|q|": -0.632,
    "Z_uud": -2.0 * 9.64,
    "M_uw": 34.6 - 4.47 - 2.0 * 6.15,
    "M_uq": 1.93 - 2.0 * 3.93,
    "M_w|w|": 3.18,
    "M_q|q|": -9.40,
    "M_uud": -2.0 * 6.15,
}
