"""Template of a vehicle class for PythonVehicleSimulator."""

HEAD = '''"""@title@

A vehicle for PythonVehicleSimulator (T. I. Fossen):

    from python_vehicle_simulator.lib import simulate
    from THIS_FILE import @class_name@
    simTime, simData = simulate(2000, 0.05, @class_name@())

@about@
As in the vehicles of the package, u_control = [rudder (rad), stern plane (rad), propeller (rpm)],
and a positive rudder turns to starboard: in the model itself, it turns to port. A positive stern
plane has its trailing edge down. V_current, beta_current: the water flows with V_current m/s
towards beta_current deg; the model moves through it, nu is over ground.

`dynamics` takes one classical Runge-Kutta step@steps@, attitude included; the package
integrates eta after it by Euler's method, so that its step should be 0.05 s or less.
nu and u_actual are where the last step ended.

@remarks@
"""

import math
from math import cos, sin

import numpy as np

# parameters of the equations
@parameters@
'''
PLANAR = '''
MASS = (
@mass@
)


def derivative(state, inputs):
    """Time derivative of the state (@states@)."""
    @states@ = state
    @acting@ = inputs
    f0, f1, f2 = (
@forces@
    )
    (m00, m01, m02), (m10, m11, m12), (m20, m21, m22) = MASS
    c0, c1, c2 = m11 * m22 - m12 * m21, m12 * m20 - m10 * m22, m10 * m21 - m11 * m20
    determinant = m00 * c0 + m01 * c1 + m02 * c2
    du = f0 * c0 + f1 * (m02 * m21 - m01 * m22) + f2 * (m01 * m12 - m02 * m11)
    da = f0 * c1 + f1 * (m00 * m22 - m02 * m20) + f2 * (m02 * m10 - m00 * m12)
    db = f0 * c2 + f1 * (m01 * m20 - m00 * m21) + f2 * (m00 * m11 - m01 * m10)
    return (du / determinant, da / determinant, db / determinant, @rate@)


def advanced(nu, eta, inputs, dt):
    """Velocities through the water and angles after a step; @rest@ stay at rest."""
    roll, pitch, heading = eta[3:6]
    state = (nu[0], nu[@lateral@], nu[@turning@], @angle@)
    @u@, @a@, @b@, @angle@ = step(state, inputs, dt)
    return @nu@, (roll, pitch, heading)
'''
WHOLE = '''
# inverse of the mass matrix, rigid body and added mass
INVERSE = (
@inverse@
)


def derivative(state, inputs):
    """Time derivative of velocities, attitude (a quaternion) and position."""
    u, v, w, p, q, r, a, b, c, d, north, east, depth = state
    @acting@ = inputs
    across, turning = math.sqrt(v * v + w * w), math.sqrt(q * q + r * r)
    sine, side = 2.0 * (a * c - b * d), 2.0 * (c * d + a * b)
    cosine = a * a - b * b - c * c + d * d
@variables@
    force = (
@forces@
    )
    return (
        *(sum(m * f for m, f in zip(row, force)) for row in INVERSE),
        0.5 * (-b * p - c * q - d * r),
        0.5 * (a * p - d * q + c * r),
        0.5 * (d * p + a * q - b * r),
        0.5 * (-c * p + b * q + a * r),
        (1.0 - 2.0 * (c * c + d * d)) * u + 2.0 * (b * c - a * d) * v + 2.0 * (b * d + a * c) * w,
        2.0 * (b * c + a * d) * u + (1.0 - 2.0 * (b * b + d * d)) * v + 2.0 * (c * d - a * b) * w,
        2.0 * (b * d - a * c) * u + 2.0 * (c * d + a * b) * v + (1.0 - 2.0 * (b * b + c * c)) * w,
    )


def quaternion(roll, pitch, heading):
    """Attitude as a unit quaternion."""
    cr, cp, ch = cos(0.5 * roll), cos(0.5 * pitch), cos(0.5 * heading)
    sr, sp, sh = sin(0.5 * roll), sin(0.5 * pitch), sin(0.5 * heading)
    return (
        cr * cp * ch + sr * sp * sh,
        sr * cp * ch - cr * sp * sh,
        cr * sp * ch + sr * cp * sh,
        cr * cp * sh - sr * sp * ch,
    )


def advanced(nu, eta, inputs, dt):
    """Velocities through the water and angles after a step."""
    state = [*nu, *quaternion(*eta[3:6]), *eta[0:3]]
    for _ in range(@substeps@):
        state = step(state, inputs, dt / @substeps@)
        length = math.sqrt(sum(x * x for x in state[6:10]))
        state[6:10] = [x / length for x in state[6:10]]
    a, b, c, d = state[6:10]
    roll = math.atan2(2.0 * (c * d + a * b), 1.0 - 2.0 * (b * b + c * c))
    pitch = math.asin(min(max(2.0 * (a * c - b * d), -1.0), 1.0))
    heading = math.atan2(2.0 * (b * c + a * d), 1.0 - 2.0 * (c * c + d * d))
    return state[:6], (roll, pitch, heading)
'''
STEP = '''

def step(state, inputs, dt):
    """State after one step of the classical Runge-Kutta method with constant inputs."""
    k1 = derivative(state, inputs)
    k2 = derivative([x + 0.5 * dt * k for x, k in zip(state, k1)], inputs)
    k3 = derivative([x + 0.5 * dt * k for x, k in zip(state, k2)], inputs)
    k4 = derivative([x + dt * k for x, k in zip(state, k3)], inputs)
    slopes = [a + 2.0 * b + 2.0 * c + d for a, b, c, d in zip(k1, k2, k3, k4)]
    return [x + dt / 6.0 * slope for x, slope in zip(state, slopes)]
'''
FIN = '''

class Fin:
    """What becomes of the order of a fin: delay, dead band, play, gain, servo; offset, stall."""

    def __init__(self, delay=0.0, deadband=0.0, backlash=0.0, asymmetry=0.0, lag=0.0,
                 slew=math.inf, offset=0.0, stall=math.inf, race=0.0, station=0.0):
        self.delay, self.deadband, self.backlash = max(delay, 0.0), deadband, backlash
        self.asymmetry, self.lag, self.slew = asymmetry, lag, slew
        self.offset, self.stall, self.race, self.station = offset, stall, race, station
        self.orders, self.taken = [], None

    def arriving(self, order, dt):
        """Orders that arrive in a step, the delay later, and how long each one stands."""
        self.orders.append((order, dt))
        wait, left, told = self.delay, dt, []
        for k in range(len(self.orders) - 1, -1, -1):
            order, span = self.orders[k]
            if wait >= span:
                wait -= span
                continue
            part = min(span - wait, left)
            told.append((order, part))
            left, wait = left - part, 0.0
            if left <= 0.0:
                del self.orders[:k]
                break
        if left > 0.0:
            told.append((order, left))
        return told[::-1]

    def turned(self, angle, order, dt):
        """Mean angle over a step from its angle at the start, and that at the end."""
        mean = 0.0
        for told, lasts in self.arriving(order, dt):
            part, angle = self.laid(angle, told, lasts)
            mean += lasts / dt * part
        return mean, angle

    def laid(self, angle, order, dt):
        """The same while an order stands."""
        order = math.copysign(max(abs(order) - self.deadband, 0.0), order)
        if self.taken is not None:
            order = min(max(self.taken, order - self.backlash), order + self.backlash)
        self.taken = order
        order *= 1.0 + self.asymmetry if order > 0.0 else 1.0 - self.asymmetry
        h, short = dt / 5, 0.0
        keep = math.exp(-h / self.lag) if self.lag > 0.0 else 0.0
        trailing = self.lag / h * (1.0 - keep) if self.lag > 0.0 else 0.0
        most = self.slew * h
        for _ in range(5):
            distance = order - angle
            turning = abs(distance) / most
            limited = 0.5 * turning if turning <= 1.0 else 1.0 - 0.5 / turning
            short += max(trailing, limited) * distance
            angle += min(max(distance * (1.0 - keep), -most), most)
        return order - short / 5, angle

    def felt(self, angle):
        """Angle that acts: with its offset, as far as the flow follows it."""
        angle += self.offset
        return angle / math.sqrt(1.0 + (angle / self.stall) ** 2)

    def raced(self, thrust, speed):
        """What the race adds to the square of the flow, to the flow, and times the station."""
        race = self.race * thrust
        flow = math.sqrt(max(speed * speed + race, 0.0)) - abs(speed)
        return race, flow, self.station * flow


def lagging(rate, ordered, lag, dt):
    """Mean rate of the propeller over a step from that at the start, and that at the end."""
    if lag <= 0.0:
        return ordered, ordered
    keep = math.exp(-dt / lag)
    mean = ordered + (rate - ordered) * (1.0 - keep) * lag / dt
    return mean, ordered + (rate - ordered) * keep


def fallen(since, over):
    """Part of a change that has been made; where only an interval is known, it rises along it."""
    since += 0.5 * over
    if since < 0.0:
        return 0.0
    return since / over if since < over else 1.0
'''
CLASS = '''

class @class_name@:
    """@vehicle@

    @class_name@()                 step inputs of rudder, stern plane and propeller
    @class_name@(V_current=0.3, beta_current=90)   in a current of 0.3 m/s to the east
    """

    def __init__(self, controlSystem="stepInput", V_current=0.0, beta_current=0.0):
        self.controlMode = "stepInput"
        self.controlDescription = "Step inputs for stern planes, rudder and propeller"
        self.V_c, self.beta_c = V_current, math.radians(beta_current)
        self.name = "@vehicle@"
        self.L = @length@  # length (m)
        self.rho = @density@  # density of water (kg/m^3)
        self.controls = ["Tail rudder (deg)", "Stern plane (deg)", "Propeller revolution (rpm)"]
        self.dimU = len(self.controls)
        self.nu = np.zeros(6)  # u, v, w, p, q, r
        self.u_actual = np.zeros(self.dimU)
        self.elapsed = 0.0  # since the start of the trial (s)
        self.rudder = Fin(@rudder@)
        self.elevator = Fin(@elevator@)

    def water(self, roll, pitch, heading):
        """Velocity of the water in body axes."""
        ahead = self.V_c * cos(self.beta_c - heading)
        aside = self.V_c * sin(self.beta_c - heading)
        u = ahead * cos(pitch)
        v = ahead * sin(pitch) * sin(roll) + aside * cos(roll)
        w = ahead * sin(pitch) * cos(roll) - aside * sin(roll)
        return np.array([u, v, w, 0.0, 0.0, 0.0])

    def acting(self, eta, speed, u_actual, u_control, dt):
        """Inputs of `derivative` as they act over a step, and the actuators at its end."""
        rudder, next_rudder = self.rudder.turned(-u_actual[0], -u_control[0], dt)
        elevator, next_elevator = self.elevator.turned(u_actual[1], u_control[1], dt)
        rate, next_rate = lagging(u_actual[2] / 60.0, u_control[2] / 60.0, @lag@, dt)
        factor = 1.0 - @sag@ * self.elapsed / 1000.0
        factor -= @fall@ * fallen(self.elapsed - @fall_time@, @fall_over@)
        weight = fallen(self.elapsed - @change_time@, @change_over@)
        thrust = (T_nn * rate * abs(rate) + T_nu * abs(rate) * speed) * factor
        rudder, elevator = self.rudder.felt(rudder), self.elevator.felt(elevator)
@raced@
        roll_angle, pitch_angle, down = eta[3], eta[4], eta[2]
        moved = np.array([-next_rudder, next_elevator, 60.0 * next_rate])
        return (@row@), moved

    def dynamics(self, eta, nu, u_actual, u_control, sampleTime):
        """[nu, u_actual] one step later."""
        nu_r = np.asarray(nu, float) - self.water(*eta[3:6])
        inputs, u_actual = self.acting(eta, nu_r[0], u_actual, u_control, sampleTime)
        nu_r, angles = advanced([float(x) for x in nu_r], eta, inputs, sampleTime)
        self.elapsed += sampleTime
        return np.array(nu_r) + self.water(*angles), u_actual

    def stepInput(self, t):
        """Rudder, stern plane (rad) and propeller (rpm) at a time."""
        rudder = math.radians(5.0) if 20.0 < t <= 60.0 else 0.0
        plane = math.radians(-2.0) if 80.0 < t <= 100.0 else 0.0
        return np.array([rudder, plane, @rpm@])
'''
