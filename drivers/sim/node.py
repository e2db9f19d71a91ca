"""Run the simulated drive and encoder in a separate process on a python-can bus, in wall-clock time.

python -m drivers.sim.node --bus udp_multicast --channel 239.74.163.2
"""

import argparse
import threading
import time
from collections.abc import Sequence

from drivers.bus import BusConfig, CanPort, PythonCanPort, open_bus
from drivers.sim.axis import two_mass
from drivers.sim.can_node import SimulatedDevice
from drivers.sim.drive_node import SimulatedDrive
from drivers.sim.encoder_node import SimulatedEncoder
from drivers.sim.plant import Plant
from drivers.sim.servo import DriveServo, Servo

_WAIT_S = 0.005  # longest wait between two checks of the timers


def serve(port: CanPort, nodes: Sequence[SimulatedDevice], stop: threading.Event) -> None:
    """Serve the nodes on this port until `stop` is set."""
    start_s = time.monotonic()
    while not stop.is_set():
        port.poll(time.monotonic() - start_s, _WAIT_S)
        for node in nodes:
            node.tick(time.monotonic() - start_s)


def main(arguments: Sequence[str] | None = None) -> None:
    """Simulate the reference axis with a drive (node 5) and a linear encoder (node 6) until interrupted."""
    parser = argparse.ArgumentParser(prog="python -m drivers.sim.node", description=main.__doc__)
    parser.add_argument("--bus", default="udp_multicast", choices=BusConfig.INTERFACES)
    parser.add_argument("--channel", default="239.74.163.2", help="as python-can names it")
    parser.add_argument("--bitrate", type=int, default=1_000_000, help="bit/s, on socketcan")
    parser.add_argument("--drive", type=int, default=5, help="node-ID of the drive")
    parser.add_argument("--encoder", type=int, default=6, help="node-ID of the encoder")
    parser.add_argument("--rated-torque", type=float, default=4.0, help="N m; a thousandth of it is the resolution")
    parser.add_argument("--seed", type=int, default=0, help="of the sensors' noise")
    given = parser.parse_args(arguments)
    axis = two_mass()
    plant = Plant(axis, seed=given.seed)
    port = PythonCanPort(open_bus(BusConfig(given.bus, given.channel, given.bitrate)))
    servo = DriveServo(Servo(), axis.drive_ratio_m_rad)
    drive = SimulatedDrive(port, plant, node_id=given.drive, servo=servo, rated_torque_n_m=given.rated_torque)
    encoder = SimulatedEncoder(port, plant, node_id=given.encoder)
    print(f"drive node {given.drive} and encoder node {given.encoder} on {given.bus}:{given.channel}", flush=True)
    try:
        serve(port, (drive, encoder), threading.Event())
    except KeyboardInterrupt:
        pass
    finally:
        port.close()


if __name__ == "__main__":
    main()
