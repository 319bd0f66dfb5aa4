import numpy as np
import pytest

from auvident.physics.ase.spheroid import datcom_slenderness, spheroid_factors

# a/b, k1, k2, k': Lamb, Hydrodynamics, art. 115 and 373 has three digits in print; the further
# ones are those of theory 2.1, which agree with Lamb's table.
LAMB = [
    (1.5, 0.303749, 0.622084, 0.095124),
    (2, 0.210015, 0.704210, 0.239424),
    (3, 0.121969, 0.803899, 0.465678),
    (4, 0.081557, 0.859761, 0.607938),
    (5, 0.059121, 0.894261, 0.699851),
    (6, 0.045183, 0.917123, 0.762315),
    (7, 0.035849, 0.933098, 0.806694),
    (8, 0.029253, 0.944728, 0.839395),
    (10, 0.020706, 0.960235, 0.883538),
    (15, 0.010865, 0.978732, 0.937071),
    (20, 0.006795, 0.986592, 0.960141),
]
PRINTED_DIGITS = 1e-6  # half a unit of the sixth decimal, and rounding of the table


@pytest.mark.parametrize(("ratio", "k1", "k2", "rotation"), LAMB)
def test_spheroid_factors_are_those_of_lamb(ratio, k1, k2, rotation):
    found = spheroid_factors(np.asarray(float(ratio)), np.asarray(1.0))
    assert found == pytest.approx((k1, k2, rotation), abs=PRINTED_DIGITS)


def test_sphere_has_half_its_displaced_mass():
    found = spheroid_factors(np.array([1.0, 1.0001]), np.array([1.0, 1.0]))
    assert found.axial == pytest.approx(0.5, abs=1e-3)  # 1.0001 is a sphere to 4 digits
    assert found.rotation == pytest.approx(0.0, abs=1e-3)


def test_slenderness_of_datcom_is_near_lamb():
    fineness = np.array([5.0, 8.0, 12.0, 20.0])
    found = spheroid_factors(fineness, np.ones_like(fineness))
    # the chart of DATCOM 4.2.1.1-20a was drawn from the same theory: 0.011 apart at most
    assert datcom_slenderness(fineness) == pytest.approx(found.lateral - found.axial, abs=0.012)
