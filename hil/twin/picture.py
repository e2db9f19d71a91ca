"""Figures of the report that show a mechanism as its textbook draws it."""

from enum import StrEnum


class Picture(StrEnum):
    """Figure of the report that shows a mechanism."""

    TIME = "residual over time"
    FORCE = "force over time, with windows"
    FRICTION = "friction over speed, by direction"
    FRICTION_LOOP = "friction over position at a reversal"
    FRICTION_OVER_TRAVEL = "change of Coulomb friction over position"
    FRICTION_OVER_LOAD = "change of friction over the torque of the motor"
    FRICTION_OVER_TIME = "change of friction over time"
    VISCOUS_OVER_TIME = "change of viscous friction over time"
    FORCE_OVER_TRAVEL = "force on the table over position"
    FORCE_OVER_TIME = "force on the table within its period"
    COGGING = "torque over motor angle within its period"
    RIPPLE = "torque per ampere over motor angle within its period"
    CONSTANT_OVER_TRAVEL = "torque per ampere over position"
    CONSTANT_OVER_TIME = "torque per ampere over time"
    LEAD_OVER_TURN = "lead error within a turn"
    LEAD_OVER_TRAVEL = "lead error over position"
    GROWTH = "growth of the lead over time"
    STIFFNESS = "change of stiffness over position"
    LOST_MOTION = "table against motor at a reversal"
    MOTOR_READING = "error of the motor encoder within a turn"
    LOAD_READING = "error of the second encoder over position"
    SCALE_READING = "error of the second encoder within its signal period"
    CHARACTERISTIC = "torque over its command"
    DELAY = "cross-correlation over lag"
    RESPONSE = "frequency response with coherence"
