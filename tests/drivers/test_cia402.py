"""CiA 402 machine: every statusword, every transition, client against drive side, homing proof."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.cia402 import (
    DISABLE_VOLTAGE,
    ENABLE_OPERATION,
    FAULT_RESET,
    POWERED,
    QUICK_STOP,
    SHUTDOWN,
    SWITCH_ON,
    Controlword,
    DriveState,
    HomingPhase,
    OperationMode,
    Statusword,
    next_controlword,
    next_homing_phase,
    state_of,
)
from drivers.sim.cia402_device import STATUS, next_state

S = DriveState

# CiA 402-2, table "state coding": mask, value.
CODING = {
    S.NOT_READY_TO_SWITCH_ON: (0x4F, 0x00),
    S.SWITCH_ON_DISABLED: (0x4F, 0x40),
    S.READY_TO_SWITCH_ON: (0x6F, 0x21),
    S.SWITCHED_ON: (0x6F, 0x23),
    S.OPERATION_ENABLED: (0x6F, 0x27),
    S.QUICK_STOP_ACTIVE: (0x6F, 0x07),
    S.FAULT_REACTION_ACTIVE: (0x4F, 0x0F),
    S.FAULT: (0x4F, 0x08),
}


@given(st.integers(0, 0xFFFF))
def test_state_is_the_one_whose_coding_matches(statusword: int) -> None:
    matching = [state for state, (mask, value) in CODING.items() if statusword & mask == value]
    assert len(matching) <= 1
    assert state_of(statusword) is (matching[0] if matching else S.UNKNOWN)


def test_the_drive_reports_each_state_as_the_client_reads_it() -> None:
    assert {state_of(bits) for bits in STATUS.values()} == set(CODING)
    for state, bits in STATUS.items():
        assert state_of(bits | 0x1E80 & ~0x40) is state  # bits 7 and 9..12 say nothing about the state


def test_words_and_modes_are_coded_as_in_the_standard() -> None:
    """Client and simulated drive have these names in common: a wrong number would be wrong on both sides."""
    commands = (DISABLE_VOLTAGE, QUICK_STOP, SHUTDOWN, SWITCH_ON, ENABLE_OPERATION, FAULT_RESET)
    assert commands == (0x00, 0x02, 0x06, 0x07, 0x0F, 0x80)
    assert [bit.value for bit in Controlword] == [0x01, 0x02, 0x04, 0x08, 0x10, 0x80, 0x100]
    assert {name: bit.value for name, bit in Statusword.__members__.items()} == {
        "VOLTAGE_ENABLED": 0x0010, "QUICK_STOP": 0x0020, "WARNING": 0x0080, "REMOTE": 0x0200, "TARGET_REACHED": 0x0400,
        "INTERNAL_LIMIT": 0x0800, "FOLLOWS_COMMAND": 0x1000, "HOMING_ATTAINED": 0x1000,
        "HOMING_ERROR": 0x2000}  # fmt: skip
    assert [mode.value for mode in OperationMode] == [0, 6, 8, 9, 10]


def test_states_are_recorded_by_the_number_of_the_standard() -> None:
    """`drive_state` of a recording; UNKNOWN counts as under power."""
    assert [state.value for state in S] == list(range(-1, 8))
    assert set(POWERED) == {S.OPERATION_ENABLED, S.QUICK_STOP_ACTIVE, S.FAULT_REACTION_ACTIVE, S.UNKNOWN}


@pytest.mark.parametrize(
    ("state", "controlword", "after"),
    [
        (S.SWITCH_ON_DISABLED, SHUTDOWN, S.READY_TO_SWITCH_ON),            # 2
        (S.READY_TO_SWITCH_ON, SWITCH_ON, S.SWITCHED_ON),                  # 3
        (S.SWITCHED_ON, ENABLE_OPERATION, S.OPERATION_ENABLED),            # 4
        (S.OPERATION_ENABLED, SWITCH_ON, S.SWITCHED_ON),                   # 5
        (S.SWITCHED_ON, SHUTDOWN, S.READY_TO_SWITCH_ON),                   # 6
        (S.READY_TO_SWITCH_ON, DISABLE_VOLTAGE, S.SWITCH_ON_DISABLED),     # 7
        (S.READY_TO_SWITCH_ON, QUICK_STOP, S.SWITCH_ON_DISABLED),          # 7
        (S.OPERATION_ENABLED, SHUTDOWN, S.READY_TO_SWITCH_ON),             # 8
        (S.OPERATION_ENABLED, DISABLE_VOLTAGE, S.SWITCH_ON_DISABLED),      # 9
        (S.SWITCHED_ON, DISABLE_VOLTAGE, S.SWITCH_ON_DISABLED),            # 10
        (S.SWITCHED_ON, QUICK_STOP, S.SWITCH_ON_DISABLED),                 # 10
        (S.OPERATION_ENABLED, QUICK_STOP, S.QUICK_STOP_ACTIVE),            # 11
        (S.QUICK_STOP_ACTIVE, DISABLE_VOLTAGE, S.SWITCH_ON_DISABLED),      # 12
        (S.FAULT, FAULT_RESET, S.SWITCH_ON_DISABLED),                      # 15
        # and what must not happen
        (S.SWITCH_ON_DISABLED, ENABLE_OPERATION, S.SWITCH_ON_DISABLED),
        (S.SWITCH_ON_DISABLED, SWITCH_ON, S.SWITCH_ON_DISABLED),
        (S.QUICK_STOP_ACTIVE, ENABLE_OPERATION, S.QUICK_STOP_ACTIVE),
        (S.FAULT, ENABLE_OPERATION, S.FAULT),
        (S.FAULT, DISABLE_VOLTAGE, S.FAULT),
        (S.FAULT_REACTION_ACTIVE, FAULT_RESET, S.FAULT_REACTION_ACTIVE),
        (S.NOT_READY_TO_SWITCH_ON, SHUTDOWN, S.NOT_READY_TO_SWITCH_ON),
    ],
)  # fmt: skip
def test_transition_of_the_drive(state: DriveState, controlword: int, after: DriveState) -> None:
    assert next_state(state, controlword, 0) is after


def test_fault_is_left_only_by_a_rising_edge_and_without_its_cause() -> None:
    assert next_state(S.FAULT, FAULT_RESET, FAULT_RESET) is S.FAULT
    assert next_state(S.FAULT, FAULT_RESET, 0, cause_gone=False) is S.FAULT
    assert next_state(S.FAULT, FAULT_RESET | ENABLE_OPERATION, ENABLE_OPERATION) is S.SWITCH_ON_DISABLED


REACHABLE = [S.SWITCH_ON_DISABLED, S.READY_TO_SWITCH_ON, S.SWITCHED_ON, S.OPERATION_ENABLED, S.QUICK_STOP_ACTIVE]


@pytest.mark.parametrize("start", REACHABLE)
@pytest.mark.parametrize(
    ("goal", "ends"),
    [
        ({"enable": True}, S.OPERATION_ENABLED),
        ({"enable": False}, S.READY_TO_SWITCH_ON),
    ],
)
def test_client_and_drive_reach_the_goal_and_stay(start: DriveState, goal: dict[str, bool], ends: DriveState) -> None:
    state, controlword, path = start, 0, []
    for _ in range(8):
        previous, controlword = controlword, next_controlword(state, previous=controlword, **goal)
        state = next_state(state, controlword, previous)
        path.append(state)
    assert path[-3:] == [ends] * 3
    assert path.index(ends) <= 4


@given(st.sampled_from(list(S)), st.integers(0, 0xFFFF), st.booleans(), st.booleans())
def test_a_quick_stop_never_enables(state: DriveState, previous: int, enable: bool, reset: bool) -> None:
    word = next_controlword(state, enable=enable, quick_stop=True, reset_fault=reset, previous=previous)
    if state not in (S.FAULT, S.FAULT_REACTION_ACTIVE):
        assert word in (QUICK_STOP, DISABLE_VOLTAGE)
    assert next_state(state, word, previous) is not S.OPERATION_ENABLED


@pytest.mark.parametrize("enable", [True, False])
@pytest.mark.parametrize("state", S)
def test_a_quick_stop_brakes_what_is_under_power_and_else_disables(state: DriveState, enable: bool) -> None:
    """An undefined state may be under power."""
    braked = state in (S.OPERATION_ENABLED, S.QUICK_STOP_ACTIVE, S.UNKNOWN)
    assert next_controlword(state, enable=enable, quick_stop=True) == (QUICK_STOP if braked else DISABLE_VOLTAGE)


@given(st.sampled_from(list(S)), st.integers(0, 0xFFFF), st.booleans())
def test_fault_reset_bit_is_an_edge_and_only_in_fault(state: DriveState, previous: int, enable: bool) -> None:
    word = next_controlword(state, enable=enable, reset_fault=True, previous=previous)
    assert bool(word & FAULT_RESET) == (state is S.FAULT and not previous & FAULT_RESET)
    assert not next_controlword(state, enable=enable, previous=previous) & FAULT_RESET


ENABLED = STATUS[S.OPERATION_ENABLED]
DONE = ENABLED | Statusword.HOMING_ATTAINED | Statusword.TARGET_REACHED


def homing(*words: int, speeds: tuple[float, ...] = ()) -> HomingPhase:
    phase = HomingPhase.READY
    for k, word in enumerate(words):
        phase = next_homing_phase(phase, word, speeds[k] if speeds else 0.0, 0.1)
    return phase


def test_homing_is_done_when_attained_reached_and_at_rest() -> None:
    assert homing(ENABLED, ENABLED, DONE) is HomingPhase.DONE
    assert homing(ENABLED, ENABLED, DONE, speeds=(1.0, 1.0, -0.1)) is HomingPhase.DONE  # the speed of standstill itself


@pytest.mark.parametrize(
    ("words", "speeds"),
    [
        ((DONE, DONE, DONE), (0.0, 0.0, 0.0)),                                       # left over from an earlier run
        ((ENABLED, ENABLED, ENABLED | Statusword.HOMING_ATTAINED), (0.0, 0.0, 0.0)),  # still on its way
        ((ENABLED, ENABLED, ENABLED | Statusword.TARGET_REACHED), (0.0, 0.0, 0.0)),   # interrupted
        ((ENABLED, ENABLED, DONE), (0.0, 0.0, 0.5)),                                  # says so, but moves
    ],
)  # fmt: skip
def test_homing_is_not_done_without_proof(words: tuple[int, ...], speeds: tuple[float, ...]) -> None:
    assert homing(*words, speeds=speeds) not in (HomingPhase.DONE, HomingPhase.FAILED)


def test_homing_fails_on_its_error_bit_and_on_losing_power() -> None:
    assert homing(ENABLED, DONE | Statusword.HOMING_ERROR) is HomingPhase.FAILED
    assert homing(ENABLED, ENABLED, STATUS[S.FAULT]) is HomingPhase.FAILED
    assert homing(ENABLED | Statusword.HOMING_ERROR, ENABLED, DONE) is HomingPhase.DONE  # an old error is no error


@given(st.lists(st.tuples(st.integers(0, 0xFFFF), st.floats(-1, 1)), max_size=12))
def test_homing_is_done_only_on_a_proven_cycle(cycles: list[tuple[int, float]]) -> None:
    phase = HomingPhase.READY
    for statusword, speed in cycles:
        before, phase = phase, next_homing_phase(phase, statusword, speed, 0.1)
        if phase is HomingPhase.DONE and before is not HomingPhase.DONE:
            assert before is HomingPhase.RUNNING
            assert statusword & 0x3400 == 0x1400
            assert abs(speed) <= 0.1
